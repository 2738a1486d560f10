"""Rockets: heat, thrust, balance."""

from support.machines.families import rocket, rocket_assembly

from buildarena_benchmark import Score, Task, score
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory, simulate
from buildarena_worker.builtin.designs.drafting import EAST, WEST


def _trial(task: Task, machine: Machine, engine: str) -> tuple[Score, Trajectory]:
    trajectory = simulate(machine, task.scenario, engine)
    return score(task, machine, trajectory), trajectory


def test_a_heated_engine_lifts_itself_and_a_cold_one_does_not(
    engine: str, tasks: dict[str, Task]
) -> None:
    heated, _ = _trial(tasks["lift-1"], rocket(), engine)
    cold, _ = _trial(tasks["lift-1"], rocket(heated=False), engine)
    assert heated.success
    assert heated.indicator > 5.0
    assert heated.metrics["heated_cannons"] == 4
    assert not cold.success
    assert 0.0 < cold.indicator < 1.0


def test_a_balanced_rocket_rises_and_a_lopsided_one_tips(
    engine: str, tasks: dict[str, Task]
) -> None:
    balanced, flight = _trial(tasks["lift-2"], rocket((EAST, WEST)), engine)
    assert balanced.success
    sideways = flight.positions[100, 0, :2] - flight.positions[0, 0, :2]
    assert abs(sideways).max() < 0.5
    lopsided, _ = _trial(tasks["lift-2"], rocket(skew=True), engine)
    assert not lopsided.success
    assert "unstable" not in lopsided.flags


def test_cannons_fire_only_from_two_seconds_on(engine: str, tasks: dict[str, Task]) -> None:
    _, flight = _trial(tasks["lift-2"], rocket(), engine)
    height = flight.positions[:, 0, 2]
    assert abs(height[50] - height[10]) < 0.1
    assert height[60] > height[50] + 1.0


def test_an_assembly_joined_by_braces_flies_as_one(engine: str, tasks: dict[str, Task]) -> None:
    machine = rocket_assembly()
    trajectory = simulate(machine, tasks["lift-3"].scenario, engine)
    result = score(tasks["lift-3"], machine, trajectory)
    assert result.success
    assert result.metrics["broken_joints"] == 0
