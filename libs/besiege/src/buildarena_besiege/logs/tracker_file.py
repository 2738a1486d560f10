"""What the game's block tracker wrote of a flight: where one block was, ten times a second.

The file is a CSV table after lines of comments; places are in the game's axes (y up), units.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.importing.xml_file import is_number, shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MAX_BYTES: Final = 16 * 1024 * 1024
"""Largest file that is read; a flight of an hour has 7 MiB."""
COLUMNS: Final = (
    "sample_index",
    "target_index",
    "target_guid",
    "target_name",
    "elapsed_seconds",
    "unity_time_seconds",
    "input_keys_held",
    "input_keys_down",
    "input_keys_up",
    "machine_integrity",
    "machine_block_health_sum",
    "machine_block_max_health_sum",
    "machine_block_count",
    "machine_cluster_count",
    "target_block_health",
    "target_block_max_health",
    "x",
    "y",
    "z",
    "rot_w",
    "rot_x",
    "rot_y",
    "rot_z",
)
"""The table's columns, in the order in which the mod writes them."""
_TEXTS: Final = frozenset(
    ("target_guid", "target_name", "input_keys_held", "input_keys_down", "input_keys_up")
)
_LARGEST: Final = 1e9

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerFile:
    """A flight as the tracker wrote it; N samples.

    Attributes:
        settings: The comments: name and value.
        targets: (N,) guids of the block that each sample is of.
        lines: (N,) which of the file's lines each sample stands in, from 1.
        index: (N,) the samples' numbers.
        time_s: (N,) since the trial began, seconds.
        integrity: (N,) share of the machine that is whole, 0 to 1.
        blocks: (N,) blocks of the machine.
        clusters: (N,) pieces that it is in.
        position: (N, 3) of the block, the game's axes, units.
    """

    settings: Mapping[str, str]
    targets: tuple[str, ...]
    lines: tuple[int, ...]
    index: Floats
    time_s: Floats
    integrity: Floats
    blocks: Floats
    clusters: Floats
    position: Floats


def read_tracker_file(data: bytes) -> TrackerFile:
    """The flight that a tracker's file has.

    Raises:
        LogIncompleteError: It is none, or was cut off; the message names the line.
    """
    if len(data) > MAX_BYTES:
        raise LogIncompleteError(f"it has {len(data):,} bytes; at most {MAX_BYTES:,} are read")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise LogIncompleteError(f"it is not UTF-8: {error.reason}") from error
    if text and not text.endswith("\n"):
        raise LogIncompleteError("its last line has no end: the file was cut off")
    lines = text.splitlines()
    first = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
    settings = dict(_setting(line) for line in lines[:first])
    header = tuple(lines[first].split(",")) if first < len(lines) else ()
    if header != COLUMNS:
        raise LogIncompleteError(_of_columns(header))
    rows, numbers = [], []
    for number, row in enumerate(csv.reader(lines[first + 1 :]), start=first + 2):
        numbers.append(number)
        rows.append(_row(row, number))
    if not rows:
        raise LogIncompleteError("it has no samples")
    values = {name: np.array([row[name] for row in rows]) for name in COLUMNS if name not in _TEXTS}
    return TrackerFile(
        settings=settings,
        targets=tuple(str(row["target_guid"]) for row in rows),
        lines=tuple(numbers),
        index=values["sample_index"],
        time_s=values["elapsed_seconds"],
        integrity=values["machine_integrity"],
        blocks=values["machine_block_count"],
        clusters=values["machine_cluster_count"],
        position=np.column_stack([values[axis] for axis in "xyz"]),
    )


def _setting(line: str) -> tuple[str, str]:
    name, _, value = line.removeprefix("#").strip().partition(",")
    return name, value


def _of_columns(header: Sequence[str]) -> str:
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        return f"it is no tracker's table: column {missing[0]} is missing"
    further = [name for name in header if name not in COLUMNS]
    if further:
        return f"column {shown(further[0])} is none of the tracker's"
    return f"its columns are not in the tracker's order: {', '.join(COLUMNS)}"


def _row(cells: Sequence[str], line: int) -> dict[str, str | float]:
    if len(cells) != len(COLUMNS):
        raise LogIncompleteError(
            f"line {line} has {len(cells)} values, not {len(COLUMNS)}: the file was cut off or "
            "changed there"
        )
    return {
        name: cell if name in _TEXTS else _number(cell, name, line)
        for name, cell in zip(COLUMNS, cells, strict=True)
    }


def _number(cell: str, name: str, line: int) -> float:
    value = float(cell) if is_number(cell) else math.nan
    if not abs(value) <= _LARGEST:
        raise LogIncompleteError(f"line {line}: {name} {shown(cell)} is no number within ±1e9")
    return value
