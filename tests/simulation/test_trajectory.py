"""Trajectories: what they hold, and that their files give it back."""

import dataclasses

import numpy as np
import pytest
from tests.simulation.designs import beam, car, deck, one_shot_bridge, replayed, rocket

from buildarena_benchmark import Task
from buildarena_simulation import (
    SIMULATION_VERSION,
    Bearing,
    Trajectory,
    TrajectoryFormatError,
    engine_version,
    read_trajectory,
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


def test_a_file_gives_back_the_trajectory(tasks: dict[str, Task]) -> None:
    bridge = simulate(replayed(one_shot_bridge()), tasks["support-1"].scenario, "mujoco")
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 1.0})
    engine = simulate(replayed(rocket()), scenario, "mujoco")
    for trajectory in (bridge, engine):
        data = write_trajectory(trajectory)
        assert _equal(read_trajectory(data), trajectory)
        assert write_trajectory(read_trajectory(data)) == data
    assert len(write_trajectory(bridge)) < 250_000  # 51 blocks, 17 s, most of it falling debris


def test_a_trajectory_tells_what_bears_the_machine_and_what_it_bears(
    engine: str, tasks: dict[str, Task]
) -> None:
    machine = replayed(deck(5, 7))
    cargo = tasks["support-1"].scenario.cargo.model_copy(update={"final_mass": 100.0})
    scenario = tasks["support-1"].scenario.model_copy(update={"cargo": cargo})
    bearing = simulate(machine, scenario, engine).bearing
    assert bearing is not None
    settled = slice(-25, None)
    assert bearing.cargo[settled] == pytest.approx(100.0, rel=0.02)
    assert bearing.ground[settled] == pytest.approx(0.0, abs=0.1)
    half = (100.0 + machine.mass) / 2
    assert bearing.terrain[settled] == pytest.approx(half, rel=0.03)
    wheels = simulate(replayed(car(drive=())), tasks["transport-1"].scenario, engine).bearing
    assert wheels is not None
    assert wheels.wheels[settled].sum(axis=1) == pytest.approx(replayed(car()).mass, rel=0.02)
    assert len(wheels.wheel_ids) == 4


def test_a_break_makes_pieces(tasks: dict[str, Task]) -> None:
    trajectory = simulate(replayed(beam(7)), tasks["support-1"].scenario, "mujoco")
    assert trajectory.pieces is not None
    assert len(set(trajectory.pieces[0])) == 1
    assert len(set(trajectory.pieces[-1])) > 1
    broken = round(trajectory.breaks[0].time_s * 25)
    assert len(set(trajectory.pieces[broken + 1])) > 1
    assert len(set(trajectory.pieces[broken - 1])) == 1


def test_a_trajectory_tells_where_it_is_from(engine: str, tasks: dict[str, Task]) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 0.4})
    trajectory = simulate(replayed(rocket()), scenario, engine)
    assert (trajectory.engine, trajectory.engine_version) == (engine, engine_version(engine))
    assert trajectory.simulation_version == SIMULATION_VERSION
    assert {"time_step_s", "gravity", "scenario"} <= set(trajectory.settings)


def test_samples_are_taken_at_25_hz_from_the_start_on(tasks: dict[str, Task]) -> None:
    scenario = tasks["support-1"].scenario.model_copy(update={"duration_s": 2.0})
    trajectory = simulate(replayed(one_shot_bridge()), scenario, "mujoco")
    assert np.allclose(trajectory.time_s, np.arange(51) / 25)
    assert trajectory.cargo_mass is not None
    assert trajectory.cargo_mass[0] == pytest.approx(5 + 1495 * 0.005)
    assert trajectory.cargo_mass[-1] == pytest.approx(5 + 1495 * 0.1)


def test_positions_are_the_points_shown_to_models(engine: str, tasks: dict[str, Task]) -> None:
    machine = replayed(car())
    scenario = tasks["transport-1"].scenario.model_copy(update={"duration_s": 0.04})
    trajectory = simulate(machine, scenario, engine)
    lift = trajectory.positions[0, 0] - machine.blocks["1"].center
    for k, block in enumerate(machine.blocks.values()):
        assert np.allclose(trajectory.positions[0, k], block.center + lift, atol=1e-4)
        turn = rotation_of(trajectory.quaternions[0, k].astype(float))
        assert np.allclose(turn, block.world_from_block.rotation, atol=1e-4)


def test_only_tracked_blocks_are_recorded(tasks: dict[str, Task]) -> None:
    scenario = tasks["transport-1"].scenario.model_copy(
        update={"duration_s": 0.2, "tracked_blocks": ("1", "3")}
    )
    trajectory = simulate(replayed(car()), scenario, "mujoco")
    assert trajectory.block_ids == ("1", "3")
    assert trajectory.positions.shape == (6, 2, 3)


def test_arrays_are_read_only(tasks: dict[str, Task]) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 0.2})
    trajectory = simulate(replayed(rocket()), scenario, "mujoco")
    with pytest.raises(ValueError, match="read-only"):
        trajectory.positions[0] = 0.0


@pytest.mark.parametrize("data", [b"", b"PAR1", b"not a parquet file at all" * 10])
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(TrajectoryFormatError):
        read_trajectory(data)
