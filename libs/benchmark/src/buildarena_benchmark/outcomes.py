"""Outcomes of jobs."""

from enum import StrEnum
from typing import Final


class Outcome(StrEnum):
    """Outcome of a job; the values are those in tables, documents and the API.

    Attributes:
        SUCCESS: The machine met the task's criterion.
        CONSTRUCTION_FAILED: The session ended without a machine that may be simulated.
        LIMIT: The session reached a limit that its owner set below the protocol's: never scored.
        EXCLUDED: The paper's protocol leaves its trial out as hacked: never scored.
        ERRORED: Infrastructure failed: never scored.
        CANCELLED: A user ended it: never scored.
    """

    SUCCESS = "success"
    UNSUCCESSFUL = "unsuccessful"
    CONSTRUCTION_FAILED = "construction_failed"
    LIMIT = "limit"
    EXCLUDED = "excluded"
    ERRORED = "errored"
    CANCELLED = "cancelled"


SIMULATED: Final = frozenset({Outcome.SUCCESS, Outcome.UNSUCCESSFUL})
"""Outcomes of machines that were finished and tried."""
SCORED: Final = SIMULATED | {Outcome.CONSTRUCTION_FAILED}
"""Outcomes that count in the averages."""
