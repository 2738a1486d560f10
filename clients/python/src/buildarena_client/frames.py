"""Responses as data frames of pandas or polars, which are loaded when needed.

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
SCALARS: Final = (int, float, bool, str)
PANDAS: Final[Mapping[type, str]] = {
    datetime: "datetime64[us, UTC]",
    float: "float64",
    int: "int64",
    bool: "bool",
    list: "object",
}
WITH_MISSING: Final = {int: "Int64", bool: "boolean"}
"""Types of pandas for columns with missing values; other types have a missing value."""
TASK_COLUMNS: Final = ("task", "version", "indicator", "unit", "custom")
"""Columns of a leaderboard's row on its task."""
FIRST: Final = (
    *("id", "job", "job_id", "name", "task", "model", "seed"),
    *("outcome", "success", "indicator"),
)
"""First columns, in this order, if present; the others follow as in the contract."""

Columns = dict[str, tuple[type, bool]]
"""The type of each column, and whether values may be missing: a scalar, datetime, list for lists of
texts, dict for documents with separate columns, object for JSON."""


def jobs_frame(jobs: Iterable[schemas.Job], *, kind: Kind = "pandas") -> Any:
    """Return a frame with a row for each job.

    Args:
        jobs: Jobs from ``Client.jobs``.
        kind: Library of the frame.

    Raises:
        MissingLibraryError: It is not installed.
    """
    return _build_frame(jobs, _columns(schemas.Job), kind)


def sweeps_frame(sweeps: Iterable[schemas.Sweep], *, kind: Kind = "pandas") -> Any:
    """Return a frame with a row for each sweep from ``Client.sweeps``; see ``jobs_frame``."""
    return _build_frame(sweeps, _columns(schemas.Sweep), kind)


def results_frame(results: Iterable[schemas.JobResult], *, kind: Kind = "pandas") -> Any:
    """Return a frame with a row for each result of ``Client.sweep_results``; see ``jobs_frame``."""
    return _build_frame(results, _columns(schemas.JobResult), kind)


def leaderboard_frame(board: schemas.Board, *, overall: bool = False, kind: Kind = "pandas") -> Any:
    """Return a frame with a row for each model on each task of a leaderboard, or overall.

    Args:
        board: Leaderboard from ``Client.leaderboard``.
        overall: True for rows over all tasks.
        kind: See ``jobs_frame``.
    """
    if overall:
        return _build_frame(board.get("overall", []), _columns(schemas.OverallRow), kind)
    rows = [
        {**{name: task[name] for name in TASK_COLUMNS}, **row}
        for task in board["tasks"]
        for row in task["rows"]
    ]
    of_task = {name: _columns(schemas.TaskBoard)[name] for name in TASK_COLUMNS}
    return _build_frame(rows, of_task | _columns(schemas.BoardRow), kind)


def _build_frame(rows: Iterable[Mapping[str, Any]], columns: Columns, kind: Kind) -> Any:
    if kind not in get_args(Kind):
        choices = ", ".join(get_args(Kind))
        raise BadArgumentError(f"{kind!r} is not a kind of frame; choose from {choices}")
    try:
        library = import_module(kind)
    except ImportError as error:
        raise MissingLibraryError(f"a {kind} frame", library=kind, extra=kind) from error
    in_order = (name for name in (*FIRST, *columns) if name in columns)
    columns = {name: columns[name] for name in in_order}
    flat = [dict(_flat(row, columns)) for row in rows]
    typed = _with_inner_columns(flat, columns)
    data = {name: [_value(row.get(name), of) for row in flat] for name, (of, _) in typed.items()}
    make = _pandas if kind == "pandas" else _polars
    return make(library, data, typed)


def _pandas(library: Any, data: Mapping[str, list[Any]], columns: Columns) -> Any:
    series = {}
    for name, (kind, may_miss) in columns.items():
        dtype = PANDAS.get(kind, "string")
        # An older service may leave out what the contract requires.
        if may_miss or None in data[name]:
            dtype = WITH_MISSING.get(kind, dtype)
        series[name] = library.Series(data[name], dtype=dtype)
    return library.DataFrame(series)


def _polars(library: Any, data: Mapping[str, list[Any]], columns: Columns) -> Any:
    types_of = {
        datetime: library.Datetime("us", "UTC"),
        list: library.List(library.String),
        object: library.String,
    }
    schema = {name: types_of.get(kind, kind) for name, (kind, _) in columns.items()}
    return library.DataFrame(data, schema=schema)


def _columns(row_type: Any, prefix: str = "", *, missing: bool = False) -> Columns:
    """Return a document's columns, possibly missing; those of inner documents by their path."""
    columns: Columns = {}
    for name, hint in get_type_hints(row_type, include_extras=True).items():
        kind, may_miss = _required(hint)
        if is_typeddict(kind):
            columns |= _columns(kind, f"{prefix}{name}.", missing=missing or may_miss)
        else:
            columns[prefix + name] = _kind(kind), missing or may_miss
    return columns


def _required(hint: Any) -> tuple[Any, bool]:
    """Return a type without None, and whether it may be None or missing."""
    if get_origin(hint) is NotRequired:
        return _required(get_args(hint)[0])[0], True
    if get_origin(hint) not in {types.UnionType, Union}:
        return hint, False
    kinds = [argument for argument in get_args(hint) if argument is not type(None)]
    return (kinds[0] if len(kinds) == 1 else object), len(kinds) < len(get_args(hint))


def _kind(hint: Any) -> type:
    named: dict[Any, type] = {Annotated: datetime, Literal: str, dict: dict}
    if hint == list[str]:
        return list
    return named.get(get_origin(hint), hint if hint in SCALARS else object)


def _flat(row: Mapping[str, Any], columns: Columns, prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Yield a document's values by path."""
    for name, value in row.items():
        path = prefix + name
        opened = columns.get(path, (dict,))[0] is dict
        if opened and isinstance(value, Mapping):
            yield from _flat(value, {} if path in columns else columns, path + ".")
        else:
            yield path, value


def _with_inner_columns(rows: list[dict[str, Any]], columns: Columns) -> Columns:
    """Return the columns, with those of inner documents in place of the documents."""
    typed: Columns = {}
    for name, (kind, may_miss) in columns.items():
        if kind is dict:
            inside = dict.fromkeys(key for row in rows for key in row if key.startswith(f"{name}."))
            typed |= {
                key: (_kind_of_values([row.get(key) for row in rows]), True) for key in inside
            }
        else:
            typed[name] = kind, may_miss
    return typed


def _kind_of_values(values: list[Any]) -> type:
    """Return the type of values that the contract leaves open."""
    present = [value for value in values if value is not None]
    kinds = {type(value) for value in present}
    if kinds == {int, float}:
        return float
    if len(kinds) == 1 and (only := kinds.pop()) in SCALARS:
        return only
    texts = all(isinstance(v, list) and all(isinstance(t, str) for t in v) for v in present)
    return list if present and texts else object


def _value(value: Any, kind: type) -> Any:
    if value is None:
        return None
    if kind is datetime:
        return datetime.fromisoformat(value).astimezone(UTC)
    if kind is object:
        return json.dumps(value)
    return float(value) if kind is float else value
