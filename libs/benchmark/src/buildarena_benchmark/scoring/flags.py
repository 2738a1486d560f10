"""Flags of scores: what they are, and those that several scorers or any trial may get."""

from dataclasses import dataclass
from typing import Final

from pydantic import with_config


@with_config(use_attribute_docstrings=True, json_schema_serialization_defaults_required=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A flag that scores can have."""

    name: str
    meaning: str
    """One sentence."""
    disqualifying: bool = True
    """Whether its trials count as failures; otherwise it informs, and never changes a rank."""
    censoring: bool = False
    """Whether the indicator is only known to be at least as great."""


NOT_DRIVEN: Final = Flag(
    name="not_driven",
    meaning="It got far enough, but wheels did not drive it: toppling, sliding and pushes do not "
    "count.",
)
NOT_CARRIED: Final = Flag(
    name="not_carried",
    meaning="The cargo got there, but the machine did not bear it on its way.",
)
NOT_AIRBORNE: Final = Flag(
    name="not_airborne",
    meaning="The machine was at its height, but touched the ground.",
)
CAME_APART: Final = Flag(
    name="came_apart", meaning="Parts came off the machine before its work was done."
)
BASE_MOVED: Final = Flag(name="base_moved", meaning="The starting block did not stay where it was.")
START_TOO_HIGH: Final = Flag(
    name="start_too_high",
    meaning="Something started at or above the height that the task allows.",
)
FORCES_NOT_MEASURED: Final = Flag(
    name="forces_not_measured",
    meaning="The trial has no contact forces, without which mechanisms and flight cannot be "
    "judged.",
)
UNSTABLE: Final = Flag(
    name="unstable", meaning="The simulation blew up: its figures are not those of a machine."
)
"""Any trial may get it, whichever scorer judges."""
REFUTED: Final = Flag(
    name="refuted",
    meaning="Verification came to other figures than the score has: it counts nowhere.",
)
"""A job gets it when it is refuted; no scorer gives it."""
