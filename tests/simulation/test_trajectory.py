"""Trajectories: what they hold, and that their files give it back."""

import dataclasses

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.families import beam, car, deck, rocket
from support.machines.references import load_machine

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
from buildarena_worker.builtin.designs.drafting import NORTH, SOUTH, UP


def _equal(first: object, second: object) -> bool:
    if isinstance(first, np.ndarray):
        return np.array_equal(first, second)
    if isinstance(first, Trajectory | Bearing):
        names = [field.name for field in dataclasses.fields(first)]
        return all(_equal(getattr(first, name), getattr(second, name)) for name in names)
    return first == second


@pytest.mark.ci
def test_a_file_gives_back_the_trajectory(tasks) -> None:
    bridge = simulate(load_machine("one-shot-bridge"), tasks["support-1"].scenario, "mujoco")
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 1.0})
    engine = simulate(rocket(), scenario, "mujoco")
    for trajectory in (bridge, engine):
        data = write_trajectory(trajectory)
        assert _equal(read_trajectory(data), trajectory)
        assert write_trajectory(read_trajectory(data)) == data
    assert len(write_trajectory(bridge)) < 250_000  # 51 blocks, 17 s, most of it falling debris


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
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


@pytest.mark.nightly(keep=1)
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


@pytest.mark.nightly(keep=1)
def test_ropes_bear_their_share_too(engine, tasks) -> None:
    draft = KeyedDraft()
    middle = draft.start()
    row = [*draft.row(middle, NORTH, 3), *draft.row(middle, SOUTH, 3)]
    draft.connect(row[2], row[5], UP, connector="Winch")
    trajectory = simulate(draft.machine, tasks["support-1"].scenario, engine)
    loads = trajectory.joint_loads
    assert loads is not None
    peaks = trajectory.joint_peaks
    assert peaks[-1].kind == "rope"
    assert loads.shape[1] == len(peaks)
    assert loads[:, -1].max() == pytest.approx(peaks[-1].ratio, abs=0.003)


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


def test_a_break_makes_pieces(tasks) -> None:
    trajectory = simulate(beam(7), tasks["support-1"].scenario, "mujoco")
    assert trajectory.pieces is not None
    assert len(set(trajectory.pieces[0])) == 1
    assert len(set(trajectory.pieces[-1])) > 1
    broken = round(trajectory.breaks[0].time_s * 25)
    assert len(set(trajectory.pieces[broken + 1])) > 1
    assert len(set(trajectory.pieces[broken - 1])) == 1


def test_a_trajectory_tells_where_it_is_from(engine, tasks) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 0.4})
    trajectory = simulate(rocket(), scenario, engine)
    assert (trajectory.engine, trajectory.engine_version) == (engine, engine_version(engine))
    assert trajectory.simulation_version == SIMULATION_VERSION
    assert {"time_step_s", "gravity", "scenario"} <= set(trajectory.settings)


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
    trajectory = simulate(machine, scenario, engine)
    lift = trajectory.positions[0, 0] - machine.blocks["1"].center
    for k, block in enumerate(machine.blocks.values()):
        assert np.allclose(trajectory.positions[0, k], block.center + lift, atol=1e-4)
        turn = rotation_of(trajectory.quaternions[0, k].astype(float))
        assert np.allclose(turn, block.world_from_block.rotation, atol=1e-4)


def test_only_tracked_blocks_are_recorded(tasks) -> None:
    scenario = tasks["transport-1"].scenario.model_copy(
        update={"duration_s": 0.2, "tracked_blocks": ("1", "3")}
    )
    trajectory = simulate(car(), scenario, "mujoco")
    assert trajectory.block_ids == ("1", "3")
    assert trajectory.positions.shape == (6, 2, 3)


def test_arrays_are_read_only(tasks) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 0.2})
    trajectory = simulate(rocket(), scenario, "mujoco")
    with pytest.raises(ValueError, match="read-only"):
        trajectory.positions[0] = 0.0


@pytest.mark.parametrize("data", [b"", b"PAR1", b"not a parquet file at all" * 10])
def test_other_bytes_are_refused(data) -> None:
    with pytest.raises(TrajectoryFormatError):
        read_trajectory(data)
