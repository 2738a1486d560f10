"""Meaning of scores' flags for rankings."""

from __future__ import annotations

from collections.abc import Collection

from buildarena_benchmark.scoring.registry import known_flags


def is_disqualified(flags: Collection[str]) -> bool:
    """Return whether a result counts as a failure in our ranking."""
    known = known_flags()
    return any(flag in known and known[flag].disqualifying for flag in flags)


def is_censored(flags: Collection[str]) -> bool:
    """Return whether a result's indicator is only known to be at least as great."""
    known = known_flags()
    return any(flag in known and known[flag].censoring for flag in flags)


def meaning(flag: str) -> str:
    """Return what a flag says; "" for one that is unknown."""
    known = known_flags().get(flag)
    return known.meaning if known else ""
