"""Whether what a runner sent is an outcome of the trial that it leased.

Nothing that a runner sends is trusted: neither the bytes of a file, which are bounded before they
are unpacked, nor that they tell of this machine in this scenario. What passes is scored here.
"""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

import hashlib
import io
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from buildarena_besiege import MachineNotPlayableError, prepare_run
from buildarena_besiege.keys import cannons
from buildarena_besiege.tracking import tracked_blocks
from buildarena_pipeline.errors import PipelineError
from buildarena_pipeline.runtime.simulators.simulator import BESIEGE
from buildarena_simulation import MachineNotSimulable, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.control import (
    PRESSES,
    KeyHold,
    ended_presses,
    varied_presses,
    written_presses,
)
from buildarena_simulation.machine import bindings_of, structure_of
from buildarena_simulation.parquet import SCHEMA_VERSION, read_trajectory, schema_of
from buildarena_simulation.placement import start_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from buildarena_geometry import KeyPress, Machine
    from buildarena_simulation import Scenario
    from buildarena_simulation.structure.model import Structure

MAX_UNPACKED_BYTES: Final = 192 << 20
"""Largest trajectory unpacked; one of the most block-seconds has some 40 MB."""
SPARE_BYTES: Final = 1 << 20
MAX_FACTS_BYTES: Final = 4 << 20
MAX_COLUMNS: Final = 32
NEAR: Final = 1e-3
"""How far a start may be from where it must be, units: float32 and the grain of stored poses."""
LATE_SAMPLES: Final = 5
"""A headless game tells of every 0.2 s, and may begin one such interval late."""
MAX_TEXT: Final = 120
MAX_SETTINGS: Final = 64


class OutcomeRefusedError(PipelineError):
    """What was sent is no outcome of this trial; the message says what is wrong with it."""


def checked_trajectory(
    data: bytes,
    *,
    simulator: str,
    version: str,
    machine: Machine,
    scenario: Scenario,
    controls: Sequence[KeyPress] | None = None,
    seed: int | None = None,
) -> Trajectory:
    """The trajectory of a file that a runner sent.

    Args:
        data: The Parquet file.
        simulator: The simulator that ran the trial.
        version: Its version that the job was submitted for.
        machine: The machine.
        scenario: What it was put through.
        controls: Key presses of this run; None for the machine's own.
        seed: Of the varied world in which it was run; None for the exact one.

    Raises:
        OutcomeRefusedError: It is no trajectory, or none of this machine in this scenario.
    """
    count = _require_bounded(data, simulator, scenario, len(machine.blocks))
    try:
        _same("schema", schema_of(data), SCHEMA_VERSION)
        trajectory = read_trajectory(data)
        _require_sound(trajectory, scenario, count)
    except OutcomeRefusedError:
        raise
    except Exception as error:
        # Strangers' files fail in more ways than a reader of our own files foresees.
        raise OutcomeRefusedError(f"these bytes are not a trajectory: {error}"[:500]) from error
    _same("settings.scenario", trajectory.settings.get("scenario"), _digest(scenario))
    _same("engine", trajectory.engine, simulator)
    if simulator == BESIEGE:
        _same("engine_version", trajectory.engine_version, version)
        _require_game(trajectory, machine, scenario)
    else:
        _same("simulation_version", trajectory.simulation_version, version)
        _require_engine(trajectory, machine, scenario, seed)
        _require_presses(trajectory, machine, scenario, controls, seed)
    return trajectory


def require_refusable(
    *,
    simulator: str,
    machine: Machine,
    scenario: Scenario,
    controls: Sequence[KeyPress] | None,
) -> None:
    """Checks that a simulator would refuse a machine, as a runner says it did.

    Raises:
        OutcomeRefusedError: It would not.
    """
    try:
        if simulator == BESIEGE:
            prepare_run(machine, scenario, name="a", run_id="a", controls=controls)
        else:
            _tracked(structure_of(machine), scenario)
    except (MachineNotPlayableError, MachineNotSimulable):
        return
    raise OutcomeRefusedError(f"{simulator} does not refuse this machine: send its trajectory")


def checked_versions(
    versions: Mapping[str, Any], *, simulator: str, version: str, trajectory: Trajectory | None
) -> Mapping[str, Any]:
    """What a runner says of its versions, as manifests keep it.

    Raises:
        OutcomeRefusedError: It is of another simulator or version, or of another one than the
            trajectory says.
    """
    _same("versions.engine", versions.get("engine"), simulator)
    _same("versions.simulation", versions.get("simulation"), version)
    if trajectory is not None and simulator != BESIEGE:
        _same("versions.engine_version", versions.get("engine_version"), trajectory.engine_version)
    return versions


def _same(what: str, found: object, wanted: object) -> None:
    if found != wanted:
        raise OutcomeRefusedError(f"{what} is {str(found)[:MAX_TEXT]!r}, not {wanted!r}")


def _require(condition: object, message: str) -> None:
    if not condition:
        raise OutcomeRefusedError(message)


def _digest(scenario: Scenario) -> str:
    return hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()[:16]


def _require_bounded(data: bytes, simulator: str, scenario: Scenario, blocks: int) -> int:
    """Looks at a file's own account of itself, before anything is unpacked.

    Returns:
        The number of instants that it tells of.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        metadata = pq.read_metadata(io.BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise OutcomeRefusedError(f"these bytes are not a trajectory: {error}"[:500]) from error
    rows, whole = int(metadata.num_rows), scenario.sample_count
    late = LATE_SAMPLES if simulator == BESIEGE else 0
    _require(whole - late <= rows <= whole, f"it has {rows:,} instants, not {whole:,}")
    _require(metadata.num_row_groups == 1, "a trajectory has one row group")
    _require(metadata.num_columns <= MAX_COLUMNS, "a trajectory has fewer columns")
    facts = sum(len(key) + len(value) for key, value in (metadata.metadata or {}).items())
    _require(facts <= MAX_FACTS_BYTES, f"its facts have {facts:,} bytes")
    group = metadata.row_group(0)
    columns = [group.column(index) for index in range(metadata.num_columns)]
    unpacked = sum(int(column.total_uncompressed_size) for column in columns)
    # Positions, quaternions, heat and pieces of each block, then what bears it and its joints.
    most = rows * (blocks * 100 + 1000) + SPARE_BYTES
    _require(
        max(unpacked, int(group.total_byte_size)) <= min(most, MAX_UNPACKED_BYTES),
        f"unpacked it has {unpacked:,} bytes: a trajectory of this machine has fewer",
    )
    for column in columns:
        _require(
            0 <= column.num_values <= min(most, MAX_UNPACKED_BYTES)
            and not column.has_dictionary_page,
            f"its column {column.path_in_schema[:MAX_TEXT]} is larger than a trajectory's",
        )
    return rows


def _require_sound(trajectory: Trajectory, scenario: Scenario, count: int) -> None:
    """Checks what is so of every trajectory, whichever simulator made it."""
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
        _require(series is None or series.dtype == kind, f"{name} is not of type {np.dtype(kind)}")
    _require(
        len(trajectory.time_s) == count and np.array_equal(trajectory.time_s, instants),
        f"its instants are not {count} at {SAMPLE_RATE_HZ} Hz",
    )
    _require(len(set(trajectory.block_ids)) == len(trajectory.block_ids), "a block comes twice")
    _require_figures(trajectory)
    _require_facts(trajectory)
    cargo = (trajectory.cargo_position, trajectory.cargo_quaternion, trajectory.cargo_mass)
    _require(
        all((part is not None) == (scenario.cargo is not None) for part in cargo),
        "it has a cargo, and the scenario none, or the other way round",
    )
    size = None if scenario.cargo is None else tuple(scenario.cargo.size)
    _same("cargo_size", trajectory.cargo_size, size)


def _require_figures(trajectory: Trajectory) -> None:
    """Checks that figures are finite.

    Of a trial that blew up engines tell nothing more, to its end; scorers flag it.
    """
    poses: list[NDArray[Any]] = [trajectory.positions, trajectory.quaternions]
    if trajectory.cargo_position is not None and trajectory.cargo_quaternion is not None:
        poses += [trajectory.cargo_position[:, None], trajectory.cargo_quaternion[:, None]]
    told = np.ones(len(trajectory.time_s), dtype=bool)
    for pose in poses:
        told &= np.isfinite(pose).all(axis=(1, 2))
    _require(told[0], "its start is not finite")
    _require((told[1:] <= told[:-1]).all(), "figures that are not finite stand between others")
    bearing = trajectory.bearing
    others: list[NDArray[Any] | None] = [trajectory.joint_loads, trajectory.cargo_mass]
    if bearing is not None:
        others += [bearing.ground, bearing.terrain, bearing.cargo, bearing.wheels]
    for series in others:
        _require(series is None or np.isfinite(series[told]).all(), "a figure is not finite")
    _require(
        trajectory.cargo_mass is None or np.isfinite(trajectory.cargo_mass).all(),
        "the cargo's mass is not finite",
    )


def _require_facts(trajectory: Trajectory) -> None:
    """Checks what is no series: texts are short, figures finite."""
    texts = [trajectory.engine, trajectory.engine_version, trajectory.simulation_version]
    figures: list[object] = []
    for peak in trajectory.joint_peaks:
        texts += [peak.joint, peak.kind]
        figures += [peak.force, peak.moment, peak.ratio]
    for event in trajectory.breaks:
        texts += [event.joint, event.kind]
        figures += [event.time_s, event.ratio, event.cargo_mass or 0.0]
    for told in trajectory.events:
        texts += [told.what, told.joint, told.held]
        figures.append(told.time_s)
    settings = trajectory.settings
    _require(
        isinstance(settings, dict) and len(settings) <= MAX_SETTINGS, "its settings are too many"
    )
    for name, value in settings.items():
        texts.append(name)
        if name == PRESSES:  # it is compared as a whole
            continue
        (texts if isinstance(value, str) else figures).append(value)  # type: ignore[arg-type]
    _require(
        all(isinstance(text, str) and len(text) <= MAX_TEXT for text in texts),
        "a text is too long, or is none",
    )
    _require(
        all(isinstance(one, (int, float)) and math.isfinite(one) for one in figures),
        "a figure among its facts is not finite, or is none",
    )


def _require_presses(
    trajectory: Trajectory,
    machine: Machine,
    scenario: Scenario,
    controls: Sequence[KeyPress] | None,
    seed: int | None,
) -> None:
    """Checks that the keys were pressed that this run has, and no others."""
    asked: Sequence[KeyHold] = machine.control_sequence if controls is None else controls
    control = scenario.control
    if seed is not None:
        asked, control = varied_presses(asked, control, seed)
    presses = ended_presses(asked, control)
    wanted = written_presses(bindings_of(machine), presses)
    _require(trajectory.settings.get(PRESSES) == wanted, "its key presses are another run's")


def _tracked(structure: Structure, scenario: Scenario) -> tuple[str, ...]:
    ids = structure.block_ids
    if scenario.tracked_blocks == "all":
        return tuple(ids)
    missing = [block for block in scenario.tracked_blocks if block not in ids]
    if missing:
        raise MachineNotSimulable(f"the machine has no block {missing[0]}, which is tracked")
    return scenario.tracked_blocks


def _require_engine(
    trajectory: Trajectory, machine: Machine, scenario: Scenario, seed: int | None
) -> None:
    """Checks that a trajectory of an engine of ours is of this machine."""
    try:
        structure = structure_of(machine)
        tracked = _tracked(structure, scenario)
    except MachineNotSimulable as error:
        raise OutcomeRefusedError(f"no engine simulates this machine: {error}") from error
    ids = structure.block_ids
    _same("block_ids", trajectory.block_ids, tracked)
    _same("cannon_ids", trajectory.cannon_ids, tuple(ids[i] for i in structure.cannons))
    names = (*structure.members.names, *structure.ropes.names)
    _same("joints", tuple(peak.joint for peak in trajectory.joint_peaks), tuple(names))
    _require(
        {event.joint for event in trajectory.breaks} <= set(names)
        and len(trajectory.breaks) <= len(names),
        "joints break that the machine does not have",
    )
    _require("start" not in trajectory.settings, "its start was chosen")
    _same("settings.seed", trajectory.settings.get("seed"), seed)
    pieces, bearing = trajectory.pieces, trajectory.bearing
    if pieces is None or bearing is None or trajectory.joint_loads is None:
        raise OutcomeRefusedError("it has no pieces, bearing or joint loads")
    _require(((pieces >= 0) & (pieces < len(ids))).all(), "its pieces name other blocks")
    _same("wheel_ids", bearing.wheel_ids, tuple(ids[i] for i in structure.wheels))
    _same("terrains", bearing.terrain.shape[1], len(scenario.terrain))
    start = start_of(structure, scenario, seed)
    shown = structure.shown[[ids.index(block) for block in tracked]]
    _near("the machine", trajectory.positions[0], start.position + shown @ start.rotation.T)
    cargo = scenario.cargo
    if cargo is not None and start.cargo is not None:
        assert trajectory.cargo_position is not None  # noqa: S101 - of every scenario with cargo
        _near("the cargo", trajectory.cargo_position[0], start.cargo.position)
        masses = [cargo.mass_at(time_s) for time_s in trajectory.time_s.tolist()]
        _require(
            np.array_equal(np.asarray(trajectory.cargo_mass), masses), "the cargo has another mass"
        )


def _near(what: str, found: NDArray[Any], wanted: NDArray[Any]) -> None:
    _require(np.allclose(found, wanted, rtol=1e-5, atol=NEAR), f"{what} starts at another place")


def _require_game(trajectory: Trajectory, machine: Machine, scenario: Scenario) -> None:
    """Checks that a trajectory of the game is of this machine: the game varies where it starts."""
    try:
        tracked = tracked_blocks(machine, scenario)
    except MachineNotPlayableError as error:
        raise OutcomeRefusedError(f"the game does not play this machine: {error}") from error
    _same("block_ids", trajectory.block_ids, tracked)
    _same("cannon_ids", trajectory.cannon_ids, cannons(machine))
    pieces = trajectory.pieces
    _require(
        pieces is None or ((pieces >= 0) & (pieces < len(machine.blocks))).all(),
        "its pieces name other blocks",
    )
