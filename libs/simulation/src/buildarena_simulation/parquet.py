"""The trajectory's file format: one Parquet table, one row per instant.

Columns `positions` and `quaternions` hold all tracked blocks of an instant, block after block; what
is not a series (ids, joint peaks, breaks, settings) is JSON in the schema's metadata under the key
`buildarena.trajectory`. `SCHEMA_VERSION` rises with everything that is added or changed.
"""

import io
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_simulation.errors import TrajectoryFormatError
from buildarena_simulation.trajectory import Bearing, Break, Event, JointPeak, Piloting, Trajectory

if TYPE_CHECKING:
    import pyarrow as pa

SCHEMA_VERSION: Final = 3
PILOTED_SCHEMA: Final = 4
"""Schema of trials with a program, which includes its senses and commands."""
_READABLE: Final = (1, 2, 3, 4)
"""Schema 1 has no pieces and no bearing forces, schema 2 no loads over time."""
_WRITABLE: Final = (2, 3, 4)
_LOADS_FROM: Final = 3

_BEARING: Final = ("ground", "terrain", "cargo", "wheels")
_KEY: Final = b"buildarena.trajectory"
_COMPRESSION_LEVEL: Final = 6
_FLOATS: Final = {"time_s": "time_s", "cargo_mass": "cargo_mass"} | {
    name: f"{name}.list.element"
    for name in (
        *("positions", "quaternions", "cargo_position", "cargo_quaternion"),
        *("joint_loads", "senses", "answers"),
        *(f"bearing_{name}" for name in _BEARING),
    )
}
"""Columns of floating-point numbers, and their paths in a file."""


def schema_for(trajectory: Trajectory) -> int:
    """Return the schema that a trajectory is written in."""
    return SCHEMA_VERSION if trajectory.piloting is None else PILOTED_SCHEMA


def write_trajectory(trajectory: Trajectory, *, schema: int | None = None) -> bytes:
    """Return the bytes of a trajectory's file; equal trajectories give equal bytes.

    Args:
        schema: 2 to write it as earlier versions did, without loads over time, or 3, without a
            program's senses, for a byte-by-byte comparison with their files.

    Raises:
        ValueError: This schema can only be read.
    """
    schema = schema_for(trajectory) if schema is None else schema
    if schema not in _WRITABLE:
        choices = " and ".join(str(version) for version in _WRITABLE)
        raise ValueError(f"files of schema {schema} are not written, only of {choices}")
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns, facts = _columns(trajectory, schema), _facts(trajectory, schema)
    table = pa.table(columns).replace_schema_metadata({_KEY: json.dumps(facts).encode()})
    out = io.BytesIO()
    pq.write_table(
        table,
        out,
        compression="zstd",
        compression_level=_COMPRESSION_LEVEL,
        use_dictionary=False,
        use_byte_stream_split=[path for name, path in _FLOATS.items() if name in columns],
        write_statistics=False,
    )
    return out.getvalue()


def _columns(trajectory: Trajectory, schema: int) -> "dict[str, pa.Array]":
    """Return the series, a row for each instant."""
    import pyarrow as pa

    count = len(trajectory.time_s)
    columns: dict[str, pa.Array] = {
        "time_s": pa.array(trajectory.time_s),
        "positions": _rows(trajectory.positions.reshape(count, -1)),
        "quaternions": _rows(trajectory.quaternions.reshape(count, -1)),
        "heated": _rows(trajectory.heated),
    }
    if trajectory.cargo_position is not None and trajectory.cargo_quaternion is not None:
        columns["cargo_position"] = _rows(trajectory.cargo_position)
        columns["cargo_quaternion"] = _rows(trajectory.cargo_quaternion)
    if trajectory.cargo_mass is not None:
        columns["cargo_mass"] = pa.array(trajectory.cargo_mass)
    if trajectory.pieces is not None:
        columns["pieces"] = _rows(trajectory.pieces)
    bearing = trajectory.bearing
    if bearing is not None:
        for name in _BEARING:
            columns[f"bearing_{name}"] = _rows(getattr(bearing, name).reshape(count, -1))
    if trajectory.joint_loads is not None and schema >= _LOADS_FROM:
        columns["joint_loads"] = _rows(trajectory.joint_loads)
    if trajectory.piloting is not None and schema >= PILOTED_SCHEMA:
        columns["senses"] = _rows(trajectory.piloting.senses)
        columns["answers"] = _rows(trajectory.piloting.answers)
    return columns


def _facts(trajectory: Trajectory, schema: int) -> dict[str, Any]:
    """Return everything except the series, as JSON values."""
    bearing, piloting = trajectory.bearing, trajectory.piloting
    facts = {
        "schema_version": schema,
        "block_ids": trajectory.block_ids,
        "cannon_ids": trajectory.cannon_ids,
        "cargo_size": trajectory.cargo_size,
        "wheel_ids": bearing.wheel_ids if bearing else None,
        "joint_peaks": [asdict(peak) for peak in trajectory.joint_peaks],
        "breaks": [asdict(event) for event in trajectory.breaks],
        "engine": trajectory.engine,
        "engine_version": trajectory.engine_version,
        "simulation_version": trajectory.simulation_version,
        "settings": dict(trajectory.settings),
    }
    if trajectory.cargo_shape != "box":
        facts["cargo_shape"] = trajectory.cargo_shape
    if trajectory.events:
        facts["events"] = [asdict(event) for event in trajectory.events]
    if piloting is not None and schema >= PILOTED_SCHEMA:
        facts |= {"sense_names": piloting.sense_names, "action_names": piloting.action_names}
    return facts


def read_trajectory(data: bytes) -> Trajectory:
    """Return the trajectory a file holds.

    Raises:
        TrajectoryFormatError: The bytes are not a trajectory of a schema this version reads.
    """
    table, facts = _opened(data)
    if facts.pop("schema_version") not in _READABLE:
        valid = ", ".join(str(version) for version in _READABLE)
        raise TrajectoryFormatError(f"only trajectories of schemas {valid} can be read")
    columns = {name: table.column(name).combine_chunks() for name in table.column_names}
    time_s = columns["time_s"].to_numpy()
    count = len(time_s)
    has_cargo = "cargo_position" in columns
    facts.update(
        time_s=time_s,
        block_ids=tuple(facts["block_ids"]),
        cannon_ids=tuple(facts["cannon_ids"]),
        cargo_size=tuple(facts["cargo_size"]) if facts["cargo_size"] else None,
        positions=_matrix(columns["positions"], count).reshape(count, -1, 3),
        quaternions=_matrix(columns["quaternions"], count).reshape(count, -1, 4),
        heated=_matrix(columns["heated"], count),
        cargo_position=_matrix(columns["cargo_position"], count) if has_cargo else None,
        cargo_quaternion=_matrix(columns["cargo_quaternion"], count) if has_cargo else None,
        cargo_mass=columns["cargo_mass"].to_numpy() if "cargo_mass" in columns else None,
        joint_peaks=tuple(JointPeak(**peak) for peak in facts["joint_peaks"]),
        breaks=tuple(Break(**event) for event in facts["breaks"]),
        events=tuple(Event(**event) for event in facts.get("events", ())),
        joint_loads=_matrix(columns["joint_loads"], count) if "joint_loads" in columns else None,
        pieces=_matrix(columns["pieces"], count) if "pieces" in columns else None,
        bearing=_bearing(columns, count, facts.pop("wheel_ids", None)),
        piloting=_piloting(
            columns, count, facts.pop("sense_names", None), facts.pop("action_names", None)
        ),
    )
    return Trajectory(**facts)


def schema_of(data: bytes) -> int:
    """Return the schema that a trajectory's file has.

    Raises:
        TrajectoryFormatError: The bytes are not a trajectory.
    """
    return int(_opened(data)[1]["schema_version"])


def _opened(data: bytes) -> "tuple[pa.Table, dict[str, Any]]":
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(data))
        facts = json.loads(table.schema.metadata[_KEY])
        int(facts["schema_version"])
    except (pa.ArrowException, KeyError, TypeError, ValueError) as error:
        raise TrajectoryFormatError(f"these bytes are not a trajectory: {error}") from error
    return table, facts


def _bearing(
    columns: "dict[str, pa.ListArray]", count: int, wheel_ids: list[str] | None
) -> Bearing | None:
    if wheel_ids is None:
        return None
    series = {name: _matrix(columns[f"bearing_{name}"], count) for name in _BEARING}
    return Bearing(
        ground=series["ground"].reshape(count),
        terrain=series["terrain"],
        cargo=series["cargo"].reshape(count),
        wheels=series["wheels"],
        wheel_ids=tuple(wheel_ids),
    )


def _piloting(
    columns: "dict[str, pa.ListArray]",
    count: int,
    senses: list[str] | None,
    actions: list[str] | None,
) -> Piloting | None:
    if senses is None or actions is None:
        return None
    return Piloting(
        sense_names=tuple(senses),
        senses=_matrix(columns["senses"], count),
        action_names=tuple(actions),
        answers=_matrix(columns["answers"], count),
    )


def _rows(matrix: NDArray[Any]) -> "pa.Array":
    import pyarrow as pa

    values = pa.array(np.ascontiguousarray(matrix).reshape(-1))
    offsets = np.arange(len(matrix) + 1, dtype=np.int32) * matrix.shape[1]
    return pa.ListArray.from_arrays(pa.array(offsets), values)


def _matrix(column: "pa.ListArray", count: int) -> NDArray[Any]:
    values = column.flatten().to_numpy(zero_copy_only=False)
    return np.ascontiguousarray(values.reshape(count, len(values) // count))
