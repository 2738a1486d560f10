"""Opaque cursors: where a page ended."""

from __future__ import annotations

import base64
import binascii
from datetime import datetime

from buildarena_api.http.problems import ProblemError
from buildarena_benchmark import ValidationIssue


def encode(created_at: datetime, id_: str) -> str:
    """The cursor behind a row."""
    return base64.urlsafe_b64encode(f"{created_at.isoformat()} {id_}".encode()).decode().rstrip("=")


def decode(cursor: str) -> tuple[datetime, str]:
    """The row that a cursor stands behind.

    Raises:
        ProblemError: It was not made by us.
    """
    try:
        text = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode()
        created_at, id_ = text.split(" ")
        when = datetime.fromisoformat(created_at)
    except (ValueError, binascii.Error, UnicodeDecodeError) as error:
        raise _bad() from error
    if when.tzinfo is None or "\0" in id_:
        raise _bad()
    return when, id_


def _bad() -> ProblemError:
    message = "not a cursor; use next_cursor of the previous page, or leave it out"
    return ProblemError(
        422, f"cursor: {message}", errors=[ValidationIssue(path="cursor", message=message)]
    )
