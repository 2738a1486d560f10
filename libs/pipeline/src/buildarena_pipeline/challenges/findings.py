"""What a check says: passed or not, and in one sentence what was expected and what was there."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a check says of a package.

    Attributes:
        check: Which check.
        passed: Whether the package does as it should.
        sentence: What was seen; of a failure also what was expected, and where.
    """

    check: str
    passed: bool
    sentence: str


class CheckFailed(ValueError):  # noqa: N818 - it is a verdict, not a fault of the program
    """A package breaks a rule; the message says what was expected and what was there."""
