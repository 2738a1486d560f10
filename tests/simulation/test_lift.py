"""Rockets: heat, thrust, balance."""

import pytest
from support.machines.families import rocket, rocket_assembly
from support.machines.trials import trial

from buildarena_benchmark import score
from buildarena_simulation import simulate
from buildarena_worker.builtin.designs.drafting import EAST, WEST


def test_a_heated_engine_lifts_itself_and_a_cold_one_does_not(engine, tasks) -> None:
    heated, _ = trial(tasks["lift-1"], rocket(), engine)
    cold, _ = trial(tasks["lift-1"], rocket(heated=False), engine)
    assert heated.success
    assert heated.indicator > 5.0
    assert heated.metrics["heated_cannons"] == 4
    assert not cold.success
    assert 0.0 < cold.indicator < 1.0


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_balanced_rocket_rises_and_a_lopsided_one_tips(engine, tasks) -> None:
    balanced, flight = trial(tasks["lift-2"], rocket((EAST, WEST)), engine)
    assert balanced.success
    sideways = flight.positions[100, 0, :2] - flight.positions[0, 0, :2]
    assert abs(sideways).max() < 0.5
    lopsided, _ = trial(tasks["lift-2"], rocket(skew=True), engine)
    assert not lopsided.success
    assert "unstable" not in lopsided.flags


def test_cannons_fire_only_from_two_seconds_on(engine, tasks) -> None:
    _, flight = trial(tasks["lift-2"], rocket(), engine)
    height = flight.positions[:, 0, 2]
    assert abs(height[50] - height[10]) < 0.1
    assert height[60] > height[50] + 1.0


def test_an_assembly_joined_by_braces_flies_as_one(engine, tasks) -> None:
    machine = rocket_assembly()
    trajectory = simulate(machine, tasks["lift-3"].scenario, engine)
    result = score(tasks["lift-3"], machine, trajectory)
    assert result.success
    assert result.metrics["broken_joints"] == 0
