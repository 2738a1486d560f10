"""Lists: one envelope for all of them, opaque cursors, and parameters that must be known."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated, Any, Final, Generic, TypeVar

from fastapi import Depends, Query, Request, params
from fastapi.dependencies.utils import get_flat_params
from fastapi.routing import APIRoute
from pydantic import (
    AwareDatetime,
    BaseModel,
    Field,
    StrictFloat,
    StrictInt,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import to_jsonable_python

from buildarena_api.http.problems import ErrorCode, ProblemError, invalid
from buildarena_backend.jobs.pages import Order, Sort, SortValue

T = TypeVar("T")
R = TypeVar("R")
MAX_ROWS: Final = 200
"""Rows of one page of a list."""
NEWEST_FIRST: Final = Order(by="created", descending=True)


class Page(BaseModel, Generic[T]):
    """A page of a list."""

    data: list[T]
    next_cursor: str | None = Field(description="Pass it as `cursor` for the next page; null: last")


@dataclass(frozen=True, slots=True, kw_only=True)
class Paging:
    """The requested page of a list."""

    cursor: Annotated[
        str | None, Query(max_length=1000, description="`next_cursor` of the page before")
    ] = None
    limit: Annotated[int, Query(ge=1, le=MAX_ROWS, description="Rows of a page")] = MAX_ROWS

    def after(self, order: Order = NEWEST_FIRST) -> tuple[Any, str] | None:
        """Return the sort value and id of the row before the page; None for the first page.

        Raises:
            ProblemError: The cursor is invalid, or of another order.
        """
        return None if self.cursor is None else decode(self.cursor, order)

    def cut(
        self, rows: Sequence[R], cursor_of: Callable[[R], str]
    ) -> tuple[Sequence[R], str | None]:
        """Return the rows of the page, without the extra one, and the next page's cursor."""
        shown = rows[: self.limit]
        return shown, cursor_of(shown[-1]) if len(rows) > self.limit else None

    def of(self, every: Sequence[T]) -> dict[str, Any]:
        """Return the page of a list that is in memory, for `Page`."""
        first = self.number or 0
        following = first + self.limit
        more = following < len(every)
        shown = list(every[first:following])
        return {"data": shown, "next_cursor": seal([following]) if more else None}

    @property
    def text(self) -> str | None:
        """The text of the cursor; None for the first page.

        Raises:
            ProblemError: The cursor is invalid.
        """
        return None if self.cursor is None else _open(self.cursor, _TEXT)[0]

    @property
    def number(self) -> int | None:
        """The number in the cursor of a numbered list; None for the first page.

        Raises:
            ProblemError: The cursor is invalid.
        """
        return None if self.cursor is None else _open(self.cursor, _NUMBER)[0]


PagingDep = Annotated[Paging, Depends()]
_Text = Annotated[str, Field(pattern=r"^[^\x00]*$", strict=True)]
_TEXT: Final = TypeAdapter(tuple[_Text])
_NUMBER: Final = TypeAdapter(tuple[Annotated[StrictInt, Field(ge=0, lt=2**63)]])
_ORDERED: Final = TypeAdapter(tuple[str, bool, Any, _Text])
_VALUES: Final[Mapping[Sort, TypeAdapter[Any]]] = {
    "created": TypeAdapter(AwareDatetime),
    "finished": TypeAdapter(AwareDatetime | None),
    "indicator": TypeAdapter(StrictFloat | None),
    "cost": TypeAdapter(Decimal | None),
}
"""Sort key of rows, as the database compares it."""


def encode(order: Order, value: SortValue, id_: str) -> str:
    """Return the cursor behind a row in some order."""
    return seal([order.by, order.descending, to_jsonable_python(value), id_])


def decode(cursor: str, order: Order) -> tuple[SortValue, str]:
    """Return the sort value and id of the row before a cursor.

    Raises:
        ProblemError: It was not made by us, or for another order.
    """
    by, descending, plain, id_ = _open(cursor, _ORDERED)
    if (by, descending) != (order.by, order.descending):
        raise _bad("belongs to a list in another order; leave it out to start at the first page")
    try:
        return _VALUES[order.by].validate_json(json.dumps(plain), strict=True), id_
    except ValidationError as error:
        raise _bad() from error


def seal(parts: Sequence[Any]) -> str:
    """Return a cursor that holds some values."""
    return base64.urlsafe_b64encode(json.dumps(parts).encode()).decode().rstrip("=")


def _open(cursor: str, kind: TypeAdapter[T]) -> T:
    try:
        return kind.validate_json(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
    except ValueError as error:
        raise _bad() from error


def _bad(
    message: str = "not a cursor; use next_cursor of the previous page, or leave it out",
) -> ProblemError:
    return invalid("cursor", message, code=ErrorCode.INVALID_CURSOR)


async def known_parameters(request: Request) -> None:
    """Refuse query parameters that the operation does not have, and single ones given twice.

    Raises:
        ProblemError: There is such a parameter.
    """
    query = request.query_params
    if not query:
        return
    route: APIRoute = request.scope["route"]
    name = f"{request.method} {route.path}"
    if name not in _known:
        _known[name] = _parameters(route)
    parameters = _known[name]
    for name in query:
        if name not in parameters:
            raise invalid(
                name, "unknown parameter", choices=parameters, code=ErrorCode.UNKNOWN_PARAMETER
            )
        if not parameters[name] and len(query.getlist(name)) > 1:
            message = "takes one value, and was given several"
            raise invalid(name, message, code=ErrorCode.REPEATED_PARAMETER)


_known: Final[dict[str, dict[str, bool]]] = {}


def _parameters(route: APIRoute) -> dict[str, bool]:
    """Return the query parameters of a route, and whether each takes several values."""
    return {
        field.alias: "list[" in str(field.field_info.annotation)
        for field in get_flat_params(route.dependant)
        if isinstance(field.field_info, params.Query)
    }
