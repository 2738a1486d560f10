"""Flags of scores, and the two readings of them that rankings can be made under."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Final

DISQUALIFYING: Final[Mapping[str, str]] = MappingProxyType(
    {
        "does_not_span": "The load did not go to both terrains: the gap's floor bore more than a "
        "tenth of it, or one terrain bore nothing.",
        "not_driven": "The machine's height and a toppling explain the distance; no wheel in "
        "contact drove it.",
        "no_wheels": "A vehicle got far without a single wheel.",
        "start_too_high": "Something started at or above the height that the task allows.",
        "twr_below_one": "A rocket rose although its thrust is less than its weight.",
        "not_carried": "The cargo got there, but the machine did not bear it on its way.",
        "not_standing": "The ground did not bear machine and cargo while the cargo was held.",
        "not_airborne": "The machine was at its height, but touched the ground.",
        "base_moved": "The starting block did not stay where it was.",
        "came_apart": "Parts came off the machine before its work was done.",
        "forces_not_measured": "The trial has no contact forces, without which mechanisms and "
        "flight cannot be judged.",
        "unstable": "The simulation blew up: its figures are not those of a machine.",
    }
)
"""What each flag says whose result counts as a failure in our ranking."""

INFORMATIVE: Final[Mapping[str, str]] = MappingProxyType(
    {
        "never_fell": "The bridge carried everything there was: its load is at least the figure "
        "that is shown.",
        "span_not_measured": "The trial has no contact forces, so whether the bridge spans was "
        "not measured.",
        "drive_not_measured": "The trial has no contacts of wheels, so whether they drove was not "
        "measured.",
    }
)
"""What each flag says that never changes a rank."""

PUBLISHED: Final = frozenset({"no_wheels", "start_too_high", "never_fell", "twr_below_one"})
"""Flags of what the published evaluation calls hacked; it knows no others."""

CENSORING: Final = "never_fell"
"""The flag of an indicator that is only known to be at least as great."""


class Reading(StrEnum):
    """How flags are read; the values are what the API and the commands take.

    Attributes:
        OURS: A disqualified trial is a failure with an indicator of 0; other flags change nothing.
        PUBLISHED: As the published evaluation does it: trials that it calls hacked are left out,
            and everything else counts as it was scored.
    """

    OURS = "ours"
    PUBLISHED = "published"


READINGS: Final = tuple(reading.value for reading in Reading)


def is_disqualified(flags: Collection[str]) -> bool:
    """Whether a result counts as a failure in our ranking."""
    return any(flag in DISQUALIFYING for flag in flags)


def is_left_out(flags: Collection[str], reading: Reading) -> bool:
    """Whether a result is in no average under a reading."""
    return reading == Reading.PUBLISHED and any(flag in PUBLISHED for flag in flags)


def is_censored(flags: Collection[str]) -> bool:
    """Whether a result's indicator is only known to be at least as great."""
    return CENSORING in flags


def meaning(flag: str) -> str:
    """What a flag says; "" for one that is unknown."""
    return DISQUALIFYING.get(flag) or INFORMATIVE.get(flag) or ""
