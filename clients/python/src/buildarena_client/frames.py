"""Answers as data frames of pandas or polars, which are loaded when they are asked for.

Columns and their types come from the contract, so that a frame without rows has them too. Times are
UTC, figures are floats, and what is missing is missing: NaN, NaT, `<NA>`, null. A field of an inner
document is a separate column, named by its path: ``usage.requests``, ``metrics.load``.
Lists of texts are lists; anything else is JSON.
"""

from __future__ import annotations

import json
import types
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from importlib import import_module
from typing import (
    Annotated,
    Any,
    Final,
    Literal,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from buildarena_client import schemas
from buildarena_client.errors import BadArgumentError, MissingLibraryError

Kind = Literal["pandas", "polars"]
KINDS: Final = ("pandas", "polars")
SCALARS: Final = {int: "int", float: "float", bool: "bool", str: "text"}
PANDAS: Final = {
    "time": "datetime64[us, UTC]",
    "float": "float64",
    "int": "int64",
    "int?": "Int64",
    "bool": "bool",
    "bool?": "boolean",
    "text": "string",
    "json": "string",
    "list": "object",
}
UNIONS: Final = (types.UnionType, Union)
TASK_COLUMNS: Final = ("task", "version", "indicator", "unit", "custom")
"""What a leaderboard's row says of its task."""
FIRST: Final = (
    *("id", "job", "job_id", "name", "task", "model", "seed"),
    *("outcome", "success", "indicator"),
)
"""What people read first, in this order, where rows have it; the rest is as in the contract."""

Columns = dict[str, str]
"""Types by name: time, float, int, bool, text, list, json; `?` for what may be missing."""


def jobs_frame(jobs: Iterable[schemas.JobView], *, kind: Kind = "pandas") -> Any:
    """A row for each job.

    Args:
        jobs: As ``Client.jobs`` gives them.
        kind: The library whose frame it is.

    Raises:
        MissingLibraryError: It is not installed.
    """
    return _frame(jobs, schemas.JobView, kind)


def sweeps_frame(sweeps: Iterable[schemas.SweepView], *, kind: Kind = "pandas") -> Any:
    """A row for each sweep.

    Args:
        sweeps: As ``Client.sweeps`` gives them.
        kind: The library whose frame it is.

    Raises:
        MissingLibraryError: It is not installed.
    """
    return _frame(sweeps, schemas.SweepView, kind)


def results_frame(results: Iterable[schemas.Result], *, kind: Kind = "pandas") -> Any:
    """A row for each scored job of a sweep.

    Args:
        results: As ``Client.sweep_results`` gives them.
        kind: The library whose frame it is.

    Raises:
        MissingLibraryError: It is not installed.
    """
    return _frame(results, schemas.Result, kind)


def leaderboard_frame(board: schemas.Board, *, overall: bool = False, kind: Kind = "pandas") -> Any:
    """A row for each model on each task of a leaderboard, or for each model overall.

    Args:
        board: As ``Client.leaderboard`` gives it.
        overall: Whether the rows are those over all tasks.
        kind: The library whose frame it is.

    Raises:
        MissingLibraryError: It is not installed.
    """
    if overall:
        return _frame(board.get("overall", []), schemas.OverallView, kind)
    rows = [
        {**{name: task[name] for name in TASK_COLUMNS}, **row}
        for task in board["tasks"]
        for row in task["rows"]
    ]
    of_task = {name: _columns(schemas.TaskBoard)[name] for name in TASK_COLUMNS}
    return _made(rows, _as_read({**of_task, **_columns(schemas.Row)}), kind)


def _frame(rows: Iterable[Any], row_type: Any, kind: Kind) -> Any:
    return _made(rows, _as_read(_columns(row_type)), kind)


def _as_read(columns: Columns) -> Columns:
    """The columns, with those that people read first before the others."""
    first = [name for name in FIRST if name in columns]
    return {name: columns[name] for name in dict.fromkeys((*first, *columns))}


def _made(rows: Iterable[Mapping[str, Any]], columns: Columns, kind: Kind) -> Any:
    if kind not in KINDS:
        raise BadArgumentError(f"{kind!r} is no kind of frame; choose from {', '.join(KINDS)}")
    try:
        library = import_module(kind)
    except ImportError as error:
        raise MissingLibraryError(f"a {kind} frame", library=kind, extra=kind) from error
    flat = [dict(_flat(row, columns)) for row in rows]
    typed = _with_inner_columns(flat, columns)
    data = {name: [_value(row.get(name), of) for row in flat] for name, of in typed.items()}
    return _pandas(library, data, typed) if kind == "pandas" else _polars(library, data, typed)


def _pandas(library: Any, data: Mapping[str, list[Any]], columns: Columns) -> Any:
    made = {
        name: library.Series(values, dtype=_pandas_type(columns[name], values))
        for name, values in data.items()
    }
    return library.DataFrame(made)


def _pandas_type(kind: str, values: list[Any]) -> str:
    # An older service may leave out what the contract requires.
    kind = _maybe(kind) if None in values else kind
    return PANDAS.get(kind) or PANDAS[kind.removesuffix("?")]


def _polars(library: Any, data: Mapping[str, list[Any]], columns: Columns) -> Any:
    types_of = {
        "time": library.Datetime("us", "UTC"),
        "float": library.Float64,
        "int": library.Int64,
        "bool": library.Boolean,
        "text": library.String,
        "json": library.String,
        "list": library.List(library.String),
    }
    schema = {name: types_of[kind.removesuffix("?")] for name, kind in columns.items()}
    return library.DataFrame(dict(data), schema=schema)


def _columns(row_type: Any, prefix: str = "") -> Columns:
    """Columns of a document; those of documents in it by their path."""
    columns: Columns = {}
    for name, hint in get_type_hints(row_type, include_extras=True).items():
        kind, missing = _required(hint)
        if is_typeddict(kind):
            # The whole document may be missing, and with it what it must have.
            inner = _columns(kind, f"{prefix}{name}.")
            columns |= {
                of: _maybe(column_kind) if missing else column_kind
                for of, column_kind in inner.items()
            }
        else:
            columns[prefix + name] = _maybe(_kind(kind)) if missing else _kind(kind)
    return columns


def _maybe(kind: str) -> str:
    return kind.removesuffix("?") + "?"


def _required(hint: Any) -> tuple[Any, bool]:
    """A type without None, and whether it may be None or not there at all."""
    if get_origin(hint) is NotRequired:
        return _required(get_args(hint)[0])[0], True
    if get_origin(hint) not in UNIONS:
        return hint, False
    kinds = [argument for argument in get_args(hint) if argument is not type(None)]
    return (kinds[0] if len(kinds) == 1 else object), len(kinds) < len(get_args(hint))


def _kind(hint: Any) -> str:
    if get_origin(hint) is Annotated:
        return "time"
    if get_origin(hint) is Literal:
        return "text"
    if get_origin(hint) is dict:
        return "dict"
    if hint == list[str]:
        return "list"
    return SCALARS.get(hint, "json")


def _flat(row: Mapping[str, Any], columns: Columns, prefix: str = "") -> Iterable[tuple[str, Any]]:
    """What a document holds, by path."""
    for name, value in row.items():
        path = prefix + name
        nested = isinstance(value, Mapping) and path not in columns
        opened = isinstance(value, Mapping) and columns.get(path, "").startswith("dict")
        if nested or opened:
            yield from _flat(value, {} if opened else columns, path + ".")
        else:
            yield path, value


def _with_inner_columns(rows: list[dict[str, Any]], columns: Columns) -> Columns:
    """The columns; those that hold documents are replaced by a column for each inner field."""
    typed: Columns = {}
    for name, kind in columns.items():
        if not kind.startswith("dict"):
            typed[name] = kind
            continue
        inside = dict.fromkeys(key for row in rows for key in row if key.startswith(f"{name}."))
        typed |= {key: _kind_of_values([row.get(key) for row in rows]) for key in inside}
    return typed


def _kind_of_values(values: list[Any]) -> str:
    """The type of what the contract leaves open."""
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int, float}:
        kinds = {float}
    if len(kinds) == 1 and (only := kinds.pop()) in SCALARS:
        return SCALARS[only] + "?"
    present = [value for value in values if value is not None]
    texts = all(isinstance(v, list) and all(isinstance(t, str) for t in v) for v in present)
    return "list?" if present and texts else "json?"


def _value(value: Any, kind: str) -> Any:
    if value is None:
        return None
    if kind.startswith("time"):
        return datetime.fromisoformat(value).astimezone(UTC)
    if kind.startswith("json"):
        return json.dumps(value)
    return float(value) if kind.startswith("float") else value
