"""What people hand in to challenges, as values: packages, what checks find, who changed what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any, Final


class PackageState(StrEnum):
    """Where a package is.

    It is received, then being checked; the checks score or refuse it. An organiser may accept or
    refuse what was checked, its owner may withdraw it.
    """

    RECEIVED = "received"
    CHECKING = "checking"
    SCORED = "scored"
    REFUSED = "refused"
    ACCEPTED = "accepted"
    WITHDRAWN = "withdrawn"


UNCHECKED: Final = (PackageState.RECEIVED, PackageState.CHECKING)
RANKED: Final = (PackageState.SCORED, PackageState.ACCEPTED)
"""States whose packages stand on a season's board."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredPackage:
    """A package.

    Attributes:
        id: Its id.
        season: Name of its season.
        track: Name of its track.
        name: What its owner calls the entry.
        owner: Id of the API key that handed it in; "" for the operator.
        hash: SHA-256 of the ZIP file.
        state: Where it is.
        reason: Why it was refused, accepted or withdrawn; None otherwise.
        report: What the checks said, a JSON object; None before.
        rules: Hash of the season that it was checked by; None before.
        points: By which it is ranked; None without a score.
        cost: Of its machine; None without a score.
        fingerprints: What near-copies share.
        created_at: When it was handed in.
        checked_at: When it was checked.
    """

    id: str
    season: str
    track: str
    name: str
    owner: str
    hash: str
    state: str
    reason: str | None
    report: Mapping[str, Any] | None
    rules: str | None
    points: float | None
    cost: int | None
    fingerprints: Sequence[str]
    created_at: datetime
    checked_at: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PackageChange:
    """Who changed a package.

    Attributes:
        changed_by: Id of the API key; "" for the operator.
        state_before: Where it was.
        state: Where it is since.
        reason: Why.
        at: When.
    """

    changed_by: str
    state_before: str
    state: str
    reason: str
    at: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What a check found.

    Attributes:
        passed: Whether every rule is kept.
        reason: The first rule that is not, in a sentence; "" where all are.
        report: All of it, a JSON object.
        rules: Hash of the season.
        points: By which it is ranked; None without a score.
        cost: Of its machine; None without a score.
        fingerprints: What near-copies share.
    """

    passed: bool
    reason: str
    report: Mapping[str, Any]
    rules: str
    points: float | None
    cost: int | None
    fingerprints: Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonChange(PackageChange):
    """Who changed a package of a season.

    Attributes:
        package: Its id.
        name: Of the entry.
    """

    package: str
    name: str
