"""Meaning of scores' flags for rankings."""

from collections.abc import Collection

from buildarena_benchmark.scoring.registry import known_flags


def is_disqualified(flags: Collection[str]) -> bool:
    """Return whether a result counts as a failure in our ranking."""
    flags_by_name = known_flags()
    return any(flag in flags_by_name and flags_by_name[flag].disqualifying for flag in flags)


def is_censored(flags: Collection[str]) -> bool:
    """Return whether a result's indicator is only known to be at least as great."""
    flags_by_name = known_flags()
    return any(flag in flags_by_name and flags_by_name[flag].censoring for flag in flags)


def meaning(flag: str) -> str:
    """Return a flag's meaning; "" for an unknown one."""
    flag_entry = known_flags().get(flag)
    return flag_entry.meaning if flag_entry else ""
