"""Results of sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from buildarena_backend.accounts.budgets import Shortage
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_geometry import KeyPress, Machine


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspended:
    """The session waits for a simulation; it goes on when that is done.

    Attributes:
        machine: What is to be simulated.
        controls: The key presses, or None for the task's own.
        final: True when the job ends with this rollout's score.
        number: Place among the job's rollouts.
    """

    machine: Machine
    controls: Sequence[KeyPress] | None
    final: bool
    number: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """The session came to its end.

    Attributes:
        best: The rollout that counts.
    """

    best: RolloutRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """The model did not build a machine that may be simulated: a scored failure.

    Attributes:
        reason: Its class, for example ``objection`` or ``turn_limit``.
        detail: A sentence for people.
    """

    reason: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitReached:
    """The session used up its requests, tokens, money or time: scored as well.

    Attributes:
        limit: Name of the job's limit.
        detail: A sentence for people.
    """

    limit: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetExhausted:
    """A budget can't pay for the next request: the job waits until there is more.

    Attributes:
        shortage: Which budget, and what is lacking.
    """

    shortage: Shortage


@dataclass(frozen=True, slots=True)
class Superseded:
    """The lease ended: another worker may have the job, so this one stops without writing."""


@dataclass(frozen=True, slots=True)
class Drained:
    """The worker stops before the next request: another takes the session up where it was left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Diverged:
    """The session asks something else than its journal says it asked: the code has changed.

    Attributes:
        detail: A sentence for people.
    """

    detail: str


SessionResult = (
    Suspended | Finished | Failed | LimitReached | BudgetExhausted | Superseded | Drained | Diverged
)


class SessionEnded(Exception):  # noqa: N818 - the way out of a workflow, not an error
    """Carries a result out of a workflow; caught in `workflow.rounds` alone.

    A workflow is plain code that calls down to the session's host, and only there it turns out
    that it can't go on.

    Attributes:
        result: How the session, or one round of it, ended.
    """

    def __init__(self, result: SessionResult) -> None:
        super().__init__(str(result))
        self.result = result


class ConstructionFailedError(SessionEnded):
    """The model gave up or broke the rules.

    Args:
        reason: Class of the failure, for example ``turn_limit``.
        detail: A sentence for people.

    Attributes:
        reason: As given.
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(Failed(reason=reason, detail=detail))
        self.reason = reason
