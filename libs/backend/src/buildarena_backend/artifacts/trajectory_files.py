"""Untrusted files of trajectories: bounded before they are unpacked, and sound after."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

import io
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from buildarena_backend.errors import UploadError
from buildarena_simulation import Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.control import PRESSES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from buildarena_simulation import Scenario

MAX_UNPACKED_BYTES: Final = 192 << 20
"""Largest trajectory unpacked; one of the most block-seconds has some 40 MB."""
SPARE_BYTES: Final = 1 << 20
MAX_FACTS_BYTES: Final = 4 << 20
MAX_COLUMNS: Final = 32
MAX_SENSED_BYTES: Final = 30_000
"""Bytes per instant of a program: a hundred sensors, all joints, gates, marks and answers."""
MAX_TEXT: Final = 120
MAX_SETTINGS: Final = 64


def same(name: str, value: object, expected: object) -> None:
    """Check that a named value is the expected one."""
    if value != expected:
        raise UploadError(f"{name} is {str(value)[:MAX_TEXT]!r}, not {expected!r}")


def require(condition: object, message: str) -> None:
    """Check a condition; a failure raises an error with the message."""
    if not condition:
        raise UploadError(message)


def require_bounded(
    data: bytes, scenario: Scenario, blocks: int, *, piloted: bool, may_end: bool
) -> int:
    """Check a file's metadata before anything is unpacked.

    Args:
        piloted: Whether a program acted.
        may_end: Whether the trial may be decided, and end, before the scenario does.

    Returns:
        The number of its instants.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        metadata = pq.read_metadata(io.BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UploadError(f"these bytes are not a trajectory: {error}"[:500]) from error
    rows, expected = int(metadata.num_rows), scenario.sample_count
    fits = 0 < rows <= expected if may_end else rows == expected
    require(fits, f"it has {rows:,} instants, not {expected:,}")
    require(metadata.num_row_groups == 1, "a trajectory has one row group")
    require(metadata.num_columns <= MAX_COLUMNS, "a trajectory has fewer columns")
    facts = sum(len(key) + len(value) for key, value in (metadata.metadata or {}).items())
    require(facts <= MAX_FACTS_BYTES, f"its facts have {facts:,} bytes")
    group = metadata.row_group(0)
    columns = [group.column(index) for index in range(metadata.num_columns)]
    unpacked = sum(int(column.total_uncompressed_size) for column in columns)
    # Positions, quaternions, heat and pieces of each block, then its supports and its joints.
    limit = rows * (blocks * 100 + 1000) + SPARE_BYTES
    if piloted:
        limit += rows * MAX_SENSED_BYTES
    require(
        max(unpacked, int(group.total_byte_size)) <= min(limit, MAX_UNPACKED_BYTES),
        f"unpacked it has {unpacked:,} bytes: a trajectory of this machine has fewer",
    )
    for column in columns:
        require(
            0 <= column.num_values <= min(limit, MAX_UNPACKED_BYTES)
            and not column.has_dictionary_page,
            f"its column {column.path_in_schema[:MAX_TEXT]} is larger than a trajectory's",
        )
    return rows


def validate_trajectory(trajectory: Trajectory, scenario: Scenario, count: int) -> None:
    """Check the invariants of trajectories of every simulator."""
    instants = np.arange(count) / SAMPLE_RATE_HZ
    for name, series, kind in (
        ("time_s", trajectory.time_s, np.float64),
        ("positions", trajectory.positions, np.float32),
        ("quaternions", trajectory.quaternions, np.float32),
        ("heated", trajectory.heated, np.bool_),
        ("pieces", trajectory.pieces, np.int16),
        ("joint_loads", trajectory.joint_loads, np.float32),
        ("cargo_mass", trajectory.cargo_mass, np.float64),
        ("cargo_position", trajectory.cargo_position, np.float32),
        ("cargo_quaternion", trajectory.cargo_quaternion, np.float32),
    ):
        require(series is None or series.dtype == kind, f"{name} is not of type {np.dtype(kind)}")
    require(
        len(trajectory.time_s) == count and np.array_equal(trajectory.time_s, instants),
        f"its instants are not {count} at {SAMPLE_RATE_HZ} Hz",
    )
    require(len(set(trajectory.block_ids)) == len(trajectory.block_ids), "a block comes twice")
    _require_figures(trajectory)
    _require_piloting(trajectory)
    _require_facts(trajectory)
    cargo = (trajectory.cargo_position, trajectory.cargo_quaternion, trajectory.cargo_mass)
    require(
        all((part is not None) == (scenario.cargo is not None) for part in cargo),
        "it has a cargo, and the scenario none, or the other way round",
    )
    size = None if scenario.cargo is None else tuple(scenario.cargo.size)
    same("cargo_size", trajectory.cargo_size, size)


def _require_figures(trajectory: Trajectory) -> None:
    """Check that figures are finite.

    After a trial has blown up, engines report no finite figures; scorers flag it.
    """
    poses: list[NDArray[Any]] = [trajectory.positions, trajectory.quaternions]
    if trajectory.cargo_position is not None and trajectory.cargo_quaternion is not None:
        poses += [trajectory.cargo_position[:, None], trajectory.cargo_quaternion[:, None]]
    finite = np.ones(len(trajectory.time_s), dtype=bool)
    for pose in poses:
        finite &= np.isfinite(pose).all(axis=(1, 2))
    require(finite[0], "its start is not finite")
    require((finite[1:] <= finite[:-1]).all(), "figures that are not finite are between others")
    bearing = trajectory.bearing
    more_series: list[NDArray[Any] | None] = [trajectory.joint_loads, trajectory.cargo_mass]
    if bearing is not None:
        more_series += [bearing.ground, bearing.terrain, bearing.cargo, bearing.wheels]
    for series in more_series:
        require(series is None or np.isfinite(series[finite]).all(), "a figure is not finite")
    require(
        trajectory.cargo_mass is None or np.isfinite(trajectory.cargo_mass).all(),
        "the cargo's mass is not finite",
    )


def _require_piloting(trajectory: Trajectory) -> None:
    """Check a program's reported senses and answers; only a repetition shows if they are true."""
    piloting = trajectory.piloting
    if piloting is None:
        return
    for name, series in (("senses", piloting.senses), ("answers", piloting.answers)):
        require(series.dtype == np.float32, f"{name} is not of type float32")
    names = (*piloting.sense_names, *piloting.action_names)
    require(len(set(names)) == len(names), "a sense or an action comes twice")
    require(
        all(isinstance(name, str) and len(name) <= MAX_TEXT for name in names),
        "a sense or an action has no name, or a long one",
    )
    asked = piloting.answers
    require(bool(((asked >= 0) & (asked <= 1)).all()), "an answer is not from 0 to 1")


def _require_facts(trajectory: Trajectory) -> None:
    """Check all but the series: texts are short, figures finite."""
    texts = [trajectory.engine, trajectory.engine_version, trajectory.simulation_version]
    figures: list[object] = []
    for peak in trajectory.joint_peaks:
        texts += [peak.joint, peak.kind]
        figures += [peak.force, peak.moment, peak.ratio]
    for event in trajectory.breaks:
        texts += [event.joint, event.kind]
        figures += [event.time_s, event.ratio, event.cargo_mass or 0.0]
    for occurrence in trajectory.events:
        texts += [occurrence.what, occurrence.joint, occurrence.held]
        figures.append(occurrence.time_s)
    settings = trajectory.settings
    require(
        isinstance(settings, dict) and len(settings) <= MAX_SETTINGS, "its settings are too many"
    )
    for name, value in settings.items():
        texts.append(name)
        if name == PRESSES:  # it is compared as a whole
            continue
        (texts if isinstance(value, str) else figures).append(value)  # type: ignore[arg-type]
    require(
        all(isinstance(text, str) and len(text) <= MAX_TEXT for text in texts),
        "a text is too long, or is none",
    )
    require(
        all(isinstance(figure, (int, float)) and math.isfinite(figure) for figure in figures),
        "a figure among its facts is not finite, or is none",
    )
