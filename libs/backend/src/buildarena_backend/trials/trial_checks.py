"""Checks that a runner's upload is an outcome of the trial that it leased.

Nothing that a runner sends is trusted: neither the bytes of a file, which are bounded before they
are unpacked, nor that they belong to this machine and scenario. Valid trials are scored here.
"""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from buildarena_backend.artifacts.trajectory_files import (
    require,
    require_bounded,
    same,
    validate_trajectory,
)
from buildarena_backend.errors import UploadError
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_backend.trials.trials import MAX_SENTENCE, REFUSED, refused
from buildarena_benchmark.scores import decided_length
from buildarena_besiege import MachineNotPlayableError, logged_trajectory, prepare_run
from buildarena_besiege.keys import cannons
from buildarena_besiege.tracking import tracked_blocks
from buildarena_simulation import ControllerFailed, MachineNotSimulable, Trajectory
from buildarena_simulation.control import (
    PRESSES,
    KeyHold,
    ended_presses,
    reaching,
    varied_presses,
    written_presses,
)
from buildarena_simulation.controllers.pilot import CONTROLLER, controller_digest
from buildarena_simulation.machine import bindings_of, structure_of
from buildarena_simulation.parquet import PILOTED_SCHEMA, SCHEMA_VERSION, read_trajectory, schema_of
from buildarena_simulation.placement import start_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from buildarena_benchmark import Task
    from buildarena_geometry import KeyPress, Machine
    from buildarena_simulation import Scenario
    from buildarena_simulation.structure.model import Structure

NEAR: Final = 1e-3
"""Tolerance of a start's position, units: float32 and the grain of stored poses."""


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
    """Return the trajectory of a file that a runner sent.

    Args:
        version: Its version that the job was submitted for.
        controls: Key presses of this run; None for the machine's own.
        seed: Seed of the varied world; None for the exact one.

    Raises:
        UploadError: It is not a trajectory of this machine in this scenario.
    """
    world = scenario.world(seed)
    piloted = bool(machine.controller) and controls is None
    may_end = simulator != BESIEGE
    count = require_bounded(data, world, len(machine.blocks), piloted=piloted, may_end=may_end)
    try:
        same("schema", schema_of(data), PILOTED_SCHEMA if piloted else SCHEMA_VERSION)
        trajectory = read_trajectory(data)
        validate_trajectory(trajectory, world, count)
    except UploadError:
        raise
    except Exception as error:
        # Untrusted files fail in more ways than our reader foresees.
        raise UploadError(f"these bytes are not a trajectory: {error}"[:500]) from error
    same("settings.scenario", trajectory.settings.get("scenario"), _digest(scenario))
    same("engine", trajectory.engine, simulator)
    if simulator == BESIEGE:
        same("engine_version", trajectory.engine_version, version)
        _require_game(trajectory, machine, scenario)
        if piloted:
            _require_program(trajectory, machine)
    else:
        same("simulation_version", trajectory.simulation_version, version)
        _require_engine(trajectory, machine, world, seed)
        _require_presses(trajectory, machine, world, controls, seed)
    return trajectory


def require_decided(trajectory: Trajectory, task: Task, *, seed: int | None) -> None:
    """Check that an engine's trial lasts until it is decided, and no longer than it must.

    Raises:
        UploadError: It is too short or too long.
    """
    expected = decided_length(task, trajectory, seed=seed)
    count = len(trajectory.time_s)
    require(count == expected, f"it has {count:,} instants, not {expected:,}, when it is decided")


def require_refusable(
    *,
    simulator: str,
    machine: Machine,
    scenario: Scenario,
    controls: Sequence[KeyPress] | None,
    versions: Mapping[str, Any],
    log: bytes | None = None,
) -> None:
    """Check that a simulator would refuse a machine, as a runner reported.

    That its program failed in the middle of the trial is seen in the log of the game. An engine's
    trial shows it when it is simulated again, so such a claim counts once it was verified.

    Args:
        controls: Key presses of this run; None for the machine's own.
        log: That of a trial in the game, where the runner sent one.

    Raises:
        UploadError: It would not.
    """
    piloted, reason = bool(machine.controller) and controls is None, versions.get(REFUSED)
    try:
        if simulator != BESIEGE:
            _tracked_ids(structure_of(machine), scenario)
            if piloted and _says_failed(reason):
                return
        else:
            prepare_run(machine, scenario, name="a", run_id="a", controls=controls)
            if piloted and log is not None:
                _require_complete(log, versions, machine, scenario)
    except ControllerFailed as failure:
        require(refused(failure).get(REFUSED) == reason, f"versions.{REFUSED} is not: {failure}")
        return
    except (MachineNotPlayableError, MachineNotSimulable):
        return
    raise UploadError(f"{simulator} does not refuse this machine: send its trajectory")


def _says_failed(reason: object) -> bool:
    """Return whether a runner's sentence reports a failed program."""
    is_sentence = isinstance(reason, str) and len(reason) <= MAX_SENTENCE
    return is_sentence and str(reason).startswith(ControllerFailed.BEGINNING)


def _require_complete(
    log: bytes, versions: Mapping[str, Any], machine: Machine, scenario: Scenario
) -> None:
    """Check that a log describes a complete trial.

    Raises:
        ControllerFailed: It does, and the program failed in it.
        UploadError: It does not.
    """
    try:
        logged_trajectory(log.decode("utf-8", "replace"), versions, machine, scenario)
    except ControllerFailed:
        raise
    except Exception as error:
        # Untrusted logs fail in more ways than a reader foresees.
        raise UploadError(f"the log does not describe the trial: {error}"[:500]) from error


def checked_versions(
    versions: Mapping[str, Any], *, simulator: str, version: str, trajectory: Trajectory | None
) -> Mapping[str, Any]:
    """Return a runner's versions in the form of manifests.

    Raises:
        UploadError: It is of another simulator or version, or of another one than the
            trajectory says.
    """
    same("versions.engine", versions.get("engine"), simulator)
    same("versions.simulation", versions.get("simulation"), version)
    if trajectory is not None and simulator != BESIEGE:
        same("versions.engine_version", versions.get("engine_version"), trajectory.engine_version)
    return versions


def _digest(scenario: Scenario) -> str:
    return hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()[:16]


def _require_presses(
    trajectory: Trajectory,
    machine: Machine,
    scenario: Scenario,
    controls: Sequence[KeyPress] | None,
    seed: int | None,
) -> None:
    """Check that the keys were pressed that this run has, and no others."""
    if machine.controller and controls is None:
        _require_program(trajectory, machine)
        return
    asked: Sequence[KeyHold] = machine.control_sequence if controls is None else controls
    control = scenario.control
    if seed is not None:
        asked, control = varied_presses(asked, control, seed)
    presses = ended_presses(asked, control)
    expected = written_presses(reaching(bindings_of(machine), presses))
    require(trajectory.settings.get(PRESSES) == expected, "its key presses are another run's")


def _require_program(trajectory: Trajectory, machine: Machine) -> None:
    # A program's actions are known only by running it, as verification does.
    expected = controller_digest(machine.controller)
    require(trajectory.settings.get(CONTROLLER) == expected, "its controller is another one")


def _tracked_ids(structure: Structure, scenario: Scenario) -> tuple[str, ...]:
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
    """Check that a trajectory of an engine of ours is of this machine."""
    try:
        structure = structure_of(machine)
        tracked = _tracked_ids(structure, scenario)
    except MachineNotSimulable as error:
        raise UploadError(f"no engine simulates this machine: {error}") from error
    ids = structure.block_ids
    same("block_ids", trajectory.block_ids, tracked)
    same("cannon_ids", trajectory.cannon_ids, tuple(ids[i] for i in structure.cannons))
    names = (*structure.members.names, *structure.ropes.names)
    same("joints", tuple(peak.joint for peak in trajectory.joint_peaks), tuple(names))
    require(
        {event.joint for event in trajectory.breaks} <= set(names)
        and len(trajectory.breaks) <= len(names),
        "joints break that the machine does not have",
    )
    require("start" not in trajectory.settings, "its start was chosen")
    same("settings.seed", trajectory.settings.get("seed"), seed)
    pieces, bearing = trajectory.pieces, trajectory.bearing
    if pieces is None or bearing is None or trajectory.joint_loads is None:
        raise UploadError("it has no pieces, bearing or joint loads")
    require(((pieces >= 0) & (pieces < len(ids))).all(), "its pieces name other blocks")
    same("wheel_ids", bearing.wheel_ids, tuple(ids[i] for i in structure.wheels))
    same("terrains", bearing.terrain.shape[1], len(scenario.terrain))
    start = start_of(structure, scenario, seed)
    shown = structure.shown[[ids.index(block) for block in tracked]]
    _near("the machine", trajectory.positions[0], start.position + shown @ start.rotation.T)
    cargo = scenario.cargo
    if cargo is not None and start.cargo is not None:
        assert trajectory.cargo_position is not None  # noqa: S101 - of every scenario with cargo
        _near("the cargo", trajectory.cargo_position[0], start.cargo.position)
        masses = [cargo.mass_at(time_s) for time_s in trajectory.time_s.tolist()]
        require(
            np.array_equal(np.asarray(trajectory.cargo_mass), masses), "the cargo has another mass"
        )


def _near(name: str, values: NDArray[Any], expected: NDArray[Any]) -> None:
    require(np.allclose(values, expected, rtol=1e-5, atol=NEAR), f"{name} starts at another place")


def _require_game(trajectory: Trajectory, machine: Machine, scenario: Scenario) -> None:
    """Check that a trajectory of the game is of this machine: the game varies where it starts."""
    try:
        tracked = tracked_blocks(machine, scenario)
    except MachineNotPlayableError as error:
        raise UploadError(f"the game does not play this machine: {error}") from error
    same("block_ids", trajectory.block_ids, tracked)
    same("cannon_ids", trajectory.cannon_ids, cannons(machine))
    pieces = trajectory.pieces
    require(
        pieces is None or ((pieces >= 0) & (pieces < len(machine.blocks))).all(),
        "its pieces name other blocks",
    )
