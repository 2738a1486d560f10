"""Opaque cursors: where a page ended."""

from __future__ import annotations

import base64
import json
from datetime import datetime
from decimal import Decimal
from typing import Any, Final

from buildarena_api.http.problems import ProblemError
from buildarena_backend.jobs.pages import Order, SortValue
from buildarena_benchmark import ValidationIssue

NEWEST_FIRST: Final = Order(by="created", descending=True)


def encode(created_at: datetime, id_: str) -> str:
    """The cursor behind a row of a list that has one order, the newest first."""
    return encode_in(NEWEST_FIRST, created_at, id_)


def decode(cursor: str) -> tuple[datetime, str]:
    """The row that a cursor stands behind.

    Raises:
        ProblemError: It was not made by us.
    """
    created_at, id_ = decode_in(cursor, NEWEST_FIRST)
    assert isinstance(created_at, datetime), "so says its order"  # noqa: S101
    return created_at, id_


def encode_in(order: Order, value: SortValue, id_: str) -> str:
    """The cursor behind a job in some order."""
    plain = value.isoformat() if isinstance(value, datetime) else value
    if isinstance(plain, Decimal):
        plain = str(plain)
    text = json.dumps([order.by, order.descending, plain, id_])
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def decode_in(cursor: str, order: Order) -> tuple[SortValue, str]:
    """What the job that a cursor stands behind is sorted by, and its id.

    Raises:
        ProblemError: It was not made by us, or for another order.
    """
    try:
        text = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode()
        by, descending, plain, id_ = json.loads(text)
        if not isinstance(id_, str) or "\0" in id_:
            raise _bad()
        if (by, descending) != (order.by, order.descending):
            raise _bad("of a page in another order; leave it out to begin anew")
        return _value(order, plain), id_
    except (ValueError, TypeError, RecursionError, ArithmeticError) as error:
        raise _bad() from error


def _value(order: Order, plain: Any) -> SortValue:
    """A cursor's value as the database compares it.

    Raises:
        ValueError: It is of another kind.
    """
    if plain is None and order.by != "created":
        return None
    if order.by in {"created", "finished"}:
        when = datetime.fromisoformat(plain)
        if when.tzinfo is None:
            raise ValueError("a time without zone")
        return when
    if order.by == "cost":
        cost = Decimal(plain)
        if not cost.is_finite():
            raise ValueError("no amount")
        return cost
    if isinstance(plain, float):
        return plain
    raise ValueError("a value of another kind")


def _bad(
    message: str = "not a cursor; use next_cursor of the previous page, or leave it out",
) -> ProblemError:
    return ProblemError(
        422, f"cursor: {message}", errors=[ValidationIssue(path="cursor", message=message)]
    )
