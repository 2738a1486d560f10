"""Flags of scores, and the two scoring policies that rankings can be made under."""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum

from buildarena_benchmark.scorers.registry import known_flags


class ScoringPolicy(StrEnum):
    """The scoring policy: how flags are read.

    Attributes:
        OURS: A disqualified trial is a failure, and a failure has an indicator of 0; other flags
            change nothing.
        PUBLISHED: As the published evaluation does it: trials that it calls hacked are left out,
            and everything else counts as it was scored, by the metric that was published where
            that is not the indicator.
    """

    OURS = "ours"
    PUBLISHED = "published"


def is_disqualified(flags: Collection[str]) -> bool:
    """Whether a result counts as a failure in our ranking."""
    known = known_flags()
    return any(flag in known and known[flag].disqualifying for flag in flags)


def is_left_out(flags: Collection[str], policy: ScoringPolicy) -> bool:
    """Whether a result is in no average under a scoring policy."""
    known = known_flags()
    return policy == ScoringPolicy.PUBLISHED and any(
        flag in known and known[flag].published for flag in flags
    )


def is_censored(flags: Collection[str]) -> bool:
    """Whether a result's indicator is only known to be at least as great."""
    known = known_flags()
    return any(flag in known and known[flag].censoring for flag in flags)


def meaning(flag: str) -> str:
    """What a flag says; "" for one that is unknown."""
    known = known_flags().get(flag)
    return known.meaning if known else ""
