"""Trajectories: what they hold, that their files give it back, and that bytes repeat."""

import dataclasses
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from support.machines.families import beam, car, deck, rocket
from support.machines.references import load_machine
from support.marks import nightly
from support.programs import captured

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment.other_kernels import simulate_with
from buildarena_geometry import kernels
from buildarena_simulation import (
    SIMULATION_VERSION,
    Bearing,
    Trajectory,
    TrajectoryFormatError,
    engine_version,
    read_trajectory,
    schema_of,
    simulate,
    write_trajectory,
)
from buildarena_simulation.engines.base import rotation_of


def _equal(first: object, second: object) -> bool:
    if isinstance(first, np.ndarray):
        return np.array_equal(first, second)
    if isinstance(first, Trajectory | Bearing):
        names = [field.name for field in dataclasses.fields(first)]
        return all(_equal(getattr(first, name), getattr(second, name)) for name in names)
    return first == second


def test_a_file_gives_back_the_trajectory(tasks) -> None:
    falls = tasks["support-1"].scenario.model_copy(update={"duration_s": 8.0})
    bridge = simulate(load_machine("one-shot-bridge"), falls, "mujoco")
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 1.0})
    engine = simulate(rocket(), scenario, "mujoco")
    for trajectory in (bridge, engine):
        data = write_trajectory(trajectory)
        assert _equal(read_trajectory(data), trajectory)
        assert write_trajectory(read_trajectory(data)) == data
    assert len(write_trajectory(bridge)) < 200_000


@pytest.mark.ci
def test_a_trajectory_tells_what_bears_the_machine_and_what_it_bears(engine, tasks) -> None:
    machine = deck(5, 7)
    cargo = tasks["support-1"].scenario.cargo.model_copy(update={"final_mass": 100.0})
    scenario = tasks["support-1"].scenario.model_copy(update={"cargo": cargo})
    bearing = simulate(machine, scenario, engine).bearing
    assert bearing is not None
    settled = slice(-25, None)
    assert bearing.cargo[settled] == pytest.approx(100.0, rel=0.02)
    assert bearing.ground[settled] == pytest.approx(0.0, abs=0.1)
    half = (100.0 + machine.mass) / 2
    assert bearing.terrain[settled] == pytest.approx(half, rel=0.03)
    wheels = simulate(car(drive=()), tasks["transport-1"].scenario, engine).bearing
    assert wheels is not None
    assert wheels.wheels[settled].sum(axis=1) == pytest.approx(car().mass, rel=0.02)
    assert len(wheels.wheel_ids) == 4


def test_a_trajectory_tells_what_each_joint_bears_over_time(engine, tasks) -> None:
    trajectory = simulate(beam(7, "t"), tasks["support-1"].scenario, engine)
    loads = trajectory.joint_loads
    assert loads is not None
    assert loads.dtype == np.float32
    assert loads.shape == (len(trajectory.time_s), len(trajectory.joint_peaks))
    assert loads[5 : round(25 * trajectory.breaks[0].time_s)].any(axis=1).all()
    assert np.array_equal(loads * 512, np.round(loads * 512))
    for column, peak in enumerate(trajectory.joint_peaks):
        assert peak.ratio <= loads[:, column].max() + 1e-5
        assert loads[:, column].max() <= peak.ratio + 1 / 512 + 1e-5
    names = [peak.joint for peak in trajectory.joint_peaks]
    for event in trajectory.breaks:
        row = int(np.searchsorted(trajectory.time_s, event.time_s - 1e-9))
        series = loads[:, names.index(event.joint)]
        assert series[row] == pytest.approx(event.ratio, abs=0.003)
        assert series[row] > 1.0
        assert not series[row + 1 :].any()
        assert (series[:row] <= 1.0).all()
    # A load that grows: the joint that breaks first is nearer to it shortly before than early on.
    first = loads[:, names.index(trajectory.breaks[0].joint)]
    broken = round(trajectory.breaks[0].time_s * 25)
    assert 0 < first[broken // 2] < first[broken - 2]
    pieces = trajectory.pieces
    assert len(set(pieces[0])) == len(set(pieces[broken - 1])) == 1
    assert len(set(pieces[broken + 1])) > 1


def test_older_files_are_read_and_can_be_written(tasks) -> None:
    scenario = tasks["support-1"].scenario.model_copy(update={"duration_s": 1.0})
    trajectory = simulate(beam(7), scenario, "mujoco")
    old = write_trajectory(trajectory, schema=2)
    assert (schema_of(old), schema_of(write_trajectory(trajectory))) == (2, 3)
    again = read_trajectory(old)
    assert again.joint_loads is None
    assert _equal(dataclasses.replace(trajectory, joint_loads=None), again)
    assert write_trajectory(again, schema=2) == old
    with pytest.raises(ValueError, match="schema 1 are not written, only of 2 and 3 and 4"):
        write_trajectory(trajectory, schema=1)
    with pytest.raises(ValueError, match="joint_loads has shape"):
        dataclasses.replace(trajectory, joint_loads=np.zeros((3, 2), dtype=np.float32))


def test_samples_are_taken_at_25_hz_from_the_start_on(tasks) -> None:
    scenario = tasks["support-1"].scenario.model_copy(update={"duration_s": 2.0})
    trajectory = simulate(load_machine("one-shot-bridge"), scenario, "mujoco")
    assert np.allclose(trajectory.time_s, np.arange(51) / 25)
    assert trajectory.cargo_mass is not None
    assert trajectory.cargo_mass[0] == pytest.approx(5 + 1495 * 0.005)
    assert trajectory.cargo_mass[-1] == pytest.approx(5 + 1495 * 0.1)


def test_positions_are_the_points_shown_to_models(engine, tasks) -> None:
    machine = car()
    scenario = tasks["transport-1"].scenario.model_copy(update={"duration_s": 0.04})
    few = scenario.model_copy(update={"tracked_blocks": ("1", "3")})
    told = simulate(machine, few, engine)
    assert told.block_ids == ("1", "3")
    assert (told.engine, told.engine_version) == (engine, engine_version(engine))
    assert told.simulation_version == SIMULATION_VERSION
    trajectory = simulate(machine, scenario, engine)
    lift = trajectory.positions[0, 0] - machine.blocks["1"].center_xyz
    for k, block in enumerate(machine.blocks.values()):
        assert np.allclose(trajectory.positions[0, k], block.center_xyz + lift, atol=1e-4)
        turn = rotation_of(trajectory.quaternions[0, k].astype(float))
        assert np.allclose(turn, block.world_from_block.rotation, atol=1e-4)


def test_other_bytes_are_refused() -> None:
    for data in (b"", b"PAR1", b"not a parquet file at all" * 10):
        with pytest.raises(TrajectoryFormatError):
            read_trajectory(data)


PROGRAM = """
import hashlib, json, sys
from pathlib import Path
from buildarena_benchmark import builtin_tasks, load_task
from buildarena_geometry import Machine
from buildarena_simulation import simulate, write_trajectory
from support.machines.references import load_machine
engine, name, task, example = sys.argv[1:]
if task == "program":
    example = Path(example)
    made = Machine.from_document(json.loads((example / "car.machine.json").read_text()))
    machine = made.with_controller((example / "to-the-mark.lua").read_text())
    scenario = load_task(example / "to-the-mark.yaml").scenario
else:
    machine, scenario = load_machine(name), builtin_tasks()[task].scenario
scenario = scenario.model_copy(update={"duration_s": 2.6})
data = write_trajectory(simulate(machine, scenario, engine, seed=5))
print(hashlib.sha256(data).hexdigest())
"""
TESTS = Path(__file__).parents[1]
EXAMPLE = TESTS.parent / "examples/control"


def _hash_in_new_process(engine: str, name: str, task: str, hash_seed: str) -> str:
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(TESTS)}
    done = captured(
        [sys.executable, "-c", PROGRAM, engine, name, task, str(EXAMPLE)], env=environment
    )
    assert done.stderr == ""
    return done.stdout


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "task"),
    [nightly("carrier", "transport-2"), nightly("beam", "support-1"), ("car", "program")],
)
def test_two_processes_give_the_same_bytes(engine, name, task) -> None:
    first, second = (_hash_in_new_process(engine, name, task, seed) for seed in ("1", "2"))
    assert first == second
    assert len(first.strip()) == 64


OTHERS = [name for name in kernels.runnable() if name != kernels.PINNED]


several = pytest.mark.skipif(not OTHERS, reason="this processor has one kind of kernels")


TASK = builtin_tasks()["support-1"]


SHORT = dataclasses.replace(TASK, scenario=TASK.scenario.model_copy(update={"duration_s": 2.6}))


@pytest.mark.ci
@several
def test_a_trial_of_other_kernels_is_repeated_to_the_byte() -> None:
    machine = load_machine("wide-deck")
    own, *others = (
        write_trajectory(trajectory)
        for trajectory in (
            simulate(machine, SHORT.scenario, "mujoco"),
            simulate_with(OTHERS[0], SHORT, machine, "mujoco"),
            simulate_with(OTHERS[0], SHORT, machine, "mujoco"),
            simulate_with(kernels.PINNED, SHORT, machine, "mujoco"),
        )
    )
    assert others[0] == others[1], "the same kernels, the same bytes"
    assert others[0] != own, "the trial tells kernels apart"
    assert others[2] == own
