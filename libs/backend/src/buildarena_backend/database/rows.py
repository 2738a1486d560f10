"""Rows as values: from a row to a dataclass, and many values as one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from sqlalchemy import (
    ARRAY,
    BindParameter,
    Column,
    Table,
    Text,
    bindparam,
)

from buildarena_backend.errors import UnknownIdError

Found = TypeVar("Found")

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Value = TypeVar("Value", bound=DataclassInstance)
else:
    Value = TypeVar("Value")


def columns_of(kind: type[Value], table: Table) -> list[Column[Any]]:
    """Return the columns of a table that a dataclass has fields of the same names for."""
    return [table.c[name] for name in kind.__dataclass_fields__]


def value_of(kind: type[Value], row: Any) -> Value:
    """Return a row as a dataclass whose fields have the names of its columns."""
    return kind(**{name: getattr(row, name) for name in kind.__dataclass_fields__})


def known(row: Found | None, kind: str, id_: str) -> Found:
    """Return the row as a value.

    Raises:
        UnknownIdError: The row does not exist.
    """
    if row is None:
        raise UnknownIdError(kind, id_)
    return row


def bound_texts(values: Sequence[str]) -> BindParameter[Sequence[str]]:
    """Return the texts as one array parameter, for ``any_`` and ``unnest``."""
    return bindparam(None, list(values), ARRAY(Text))
