"""The telemetry of BuildArena 2.0's toolkit: a table of poses, its columns found by name.

A row is of one block at one moment, or of the starting block where there is no column of blocks.
Comment lines before the header begin with "#". Positions are in Besiege's components, where blocks
have their origin.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.logs.log_samples import LONGEST_GAP_S
from buildarena_besiege.logs.resampling import (
    require_no_gap,
    resampled,
    sample_instants,
    stacked,
)
from buildarena_besiege.logs.trajectories import Samples, made_trajectory
from buildarena_besiege.names import CARGO_ID
from buildarena_besiege.tracking import tracked_blocks
from buildarena_geometry.besiege_components import pose_from_besiege
from buildarena_geometry.rotations import ORIGIN, SHORTEST_QUATERNION

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from buildarena_geometry import Machine
    from buildarena_simulation import Scenario, Trajectory

COLUMNS: Final = {
    "time": ("elapsed_seconds", "elapsed_s", "time_s", "time", "t"),
    "block": ("target_guid", "block_guid", "guid"),
    "x": ("x", "pos_x", "position_x"),
    "y": ("y", "pos_y", "position_y"),
    "z": ("z", "pos_z", "position_z"),
    "qw": ("rot_w", "rotation_w", "quat_w", "qw"),
    "qx": ("rot_x", "rotation_x", "quat_x", "qx"),
    "qy": ("rot_y", "rotation_y", "quat_y", "qy"),
    "qz": ("rot_z", "rotation_z", "quat_z", "qz"),
}
"""What a column may be called that holds a value; the first names are those of public files."""

MAX_ROWS: Final = 2_000_000
_NEEDED: Final = ("time", "x", "y", "z")
_TURNS: Final = ("qw", "qx", "qy", "qz")
_BLOCKS: Final = "# buildarena blocks "
_MAX_COLUMNS: Final = 200
_LARGEST: Final = 1e7  # units; nothing in the game goes farther


@dataclass(frozen=True, slots=True, kw_only=True)
class Telemetry:
    """A run's telemetry, whole and sound.

    Attributes:
        time_s: (M,) of each block by its guid, increasing, seconds.
        positions: (M, 3) of each block, Besiege's components, units.
        rotations: (M, 4) of each block, (w, x, y, z); empty where there are no such columns.
        unknown: the columns that are not read.
    """

    time_s: Mapping[str, NDArray[np.float64]]
    positions: Mapping[str, NDArray[np.float64]]
    rotations: Mapping[str, NDArray[np.float64]]
    unknown: tuple[str, ...]


def telemetry_log(text: str, block_ids: Mapping[str, str]) -> str:
    """What is stored of a run: its telemetry as it came, after a line that names its blocks.

    Args:
        text: The table.
        block_ids: The ids of the machine's blocks by the guids of its file; the cargo's too.
    """
    return f"{_BLOCKS}{json.dumps(block_ids, sort_keys=True)}\n{text}"


def telemetry_trajectory(
    log: str, machine: Machine, scenario: Scenario, *, game: str, mod: str
) -> Trajectory:
    """The trajectory in a run's telemetry.

    Args:
        log: What `telemetry_log` made.
        machine: The machine that was played.
        scenario: The scenario it was prepared for.
        game: Version of the game.
        mod: Version of the toolkit.

    Raises:
        LogIncompleteError: Something that a score needs is missing, or is none.
    """
    first, _, text = log.partition("\n")
    try:
        block_ids = json.loads(first.removeprefix(_BLOCKS))
        guids = {str(block_id): str(guid).lower() for guid, block_id in block_ids.items()}
    except (ValueError, AttributeError, RecursionError) as error:
        raise LogIncompleteError("The telemetry does not say which block is which.") from error
    telemetry = read_telemetry(text, start=guids.get(next(iter(machine.blocks)), ""))
    ids = tracked_blocks(machine, scenario)
    wanted = {block_id: f"block {block_id}" for block_id in ids}
    if scenario.cargo is not None:
        wanted[CARGO_ID] = "the cargo"
    for block_id, name in wanted.items():
        if guids.get(block_id) not in telemetry.time_s:
            raise LogIncompleteError(f"The telemetry tells nothing of {name}.")
    longest = max(
        (
            require_no_gap(
                telemetry.time_s[guids[block_id]],
                name=name,
                longest_s=LONGEST_GAP_S,
                first_s=0.0,
                last_s=scenario.duration_s,
            )
            for block_id, name in wanted.items()
        ),
        default=0.0,
    )
    instants = sample_instants(scenario.duration_s)

    def placed(block_id: str) -> NDArray[np.float64]:
        guid = guids[block_id]
        return resampled(instants, telemetry.time_s[guid], telemetry.positions[guid])

    cargo = scenario.cargo
    samples = Samples(
        block_ids=ids,
        positions=stacked([placed(block_id) for block_id in ids], (len(instants), 0, 3)),
        burning=np.zeros((len(instants), len(ids)), dtype=bool),
        cargo=None if cargo is None else placed(CARGO_ID),
        mass=None if cargo is None else np.full(len(instants), cargo.initial_mass),
        quaternions=_quaternions(telemetry, machine, ids, guids, instants),
        settings={
            "longest_gap_s": round(longest, 6),
            "lag": "not told by the log",
            "cargo_mass": "not told by the log",
            "burning": "not told by the log",
            "log": hashlib.sha256(log.encode("utf-8", "replace")).hexdigest()[:16],
        },
    )
    return made_trajectory(samples, machine, scenario, version=f"{game}-{mod}")


def read_telemetry(text: str, *, start: str) -> Telemetry:
    """A table of telemetry.

    Args:
        text: The table.
        start: The guid that rows are of where no column says it: the starting block's.

    Raises:
        LogIncompleteError: It is cut off, a column is missing or doubtful, or a value is none.
    """
    if not text.endswith("\n"):
        raise LogIncompleteError("The telemetry is cut off: its last line has no end.")
    lines = (line for line in io.StringIO(text) if not line.startswith("#"))
    rows = csv.reader(lines, strict=True)
    try:
        header = next(rows, [])
        columns, unknown = _columns(header)
        by_block: dict[str, list[tuple[float, ...]]] = {}
        for number, row in enumerate(rows, start=1):
            if number > MAX_ROWS:
                raise LogIncompleteError(f"The telemetry has more than {MAX_ROWS:,} rows.")
            if len(row) != len(header):
                raise LogIncompleteError(
                    f"Row {number} of the telemetry has {len(row)} fields, its header "
                    f"{len(header)}."
                )
            guid = row[columns["block"]].strip().lower() if "block" in columns else start
            by_block.setdefault(guid, []).append(tuple(_values(row, columns, number)))
    except csv.Error as error:
        raise LogIncompleteError(f"The telemetry is not a table: {error}.") from error
    if not by_block:
        raise LogIncompleteError("The telemetry has no rows.")
    arrays = {guid: np.array(values, np.float64) for guid, values in by_block.items()}
    for guid, values in arrays.items():
        if not (np.diff(values[:, 0]) > 0.0).all():
            raise LogIncompleteError(f"The telemetry's times of {guid[:64]!r} do not rise.")
    turned = all(name in columns for name in _TURNS)
    return Telemetry(
        time_s={guid: values[:, 0] for guid, values in arrays.items()},
        positions={guid: values[:, 1:4] for guid, values in arrays.items()},
        rotations={guid: values[:, 4:8] for guid, values in arrays.items()} if turned else {},
        unknown=unknown,
    )


def _columns(header: list[str]) -> tuple[dict[str, int], tuple[str, ...]]:
    """Where each value is, and the columns that hold none that is read."""
    names = [name.strip().lower().removeprefix("\ufeff") for name in header]
    if not 0 < len(names) <= _MAX_COLUMNS:
        raise LogIncompleteError(f"The telemetry has {len(names)} columns.")
    columns: dict[str, int] = {}
    for value, choices in COLUMNS.items():
        places = [place for place, name in enumerate(names) if name in choices]
        if len(places) > 1:
            both = ", ".join(names[place] for place in places)
            raise LogIncompleteError(
                f"Several columns of the telemetry may be its {value}: {both}."
            )
        if places:
            columns[value] = places[0]
        elif value in _NEEDED:
            raise LogIncompleteError(
                f"No column of the telemetry is its {value}: none is called {', '.join(choices)}."
            )
    read = set(columns.values())
    return columns, tuple(name[:64] for place, name in enumerate(names) if place not in read)


def _values(row: list[str], columns: Mapping[str, int], number: int) -> Iterator[float]:
    for name in (*_NEEDED, *_TURNS):
        if name not in columns:
            continue
        text = row[columns[name]].strip()
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) <= _LARGEST or "_" in text:
            raise LogIncompleteError(
                f"Row {number} of the telemetry: {name} is {text[:40]!r}, which is not a number."
            )
        yield value


def _quaternions(
    telemetry: Telemetry,
    machine: Machine,
    ids: tuple[str, ...],
    guids: Mapping[str, str],
    instants: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """(T, N, 4) world_from_block, each of the nearest row; None where turns are not told."""
    if not telemetry.rotations:
        return None
    series = []
    for block_id in ids:
        time_s, rotations = telemetry.time_s[guids[block_id]], telemetry.rotations[guids[block_id]]
        after = np.clip(np.searchsorted(time_s, instants), 1, max(len(time_s) - 1, 1))
        after = np.minimum(after, len(time_s) - 1)
        before = np.maximum(after - 1, 0)
        closer = instants - time_s[before] < time_s[after] - instants
        turns = []
        for w, x, y, z in rotations[np.where(closer, before, after)].tolist():
            if math.hypot(w, x, y, z) < SHORTEST_QUATERNION:
                raise LogIncompleteError(
                    f"The telemetry has a turn of block {block_id} that is none."
                )
            pose = pose_from_besiege(machine.blocks[block_id].module, ORIGIN, (w, x, y, z))
            turns.append(pose.wxyz)
        series.append(np.array(turns, np.float64))
    return stacked(series, (len(instants), 0, 4))
