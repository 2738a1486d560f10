"""Flights round a planet: what counts as a way round, and what as a landing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np
import pytest
from support.machines.building import built
from support.machines.piloted import FASTER_FIRST, experts_machine, scored

from buildarena_benchmark import Task, builtin_tasks, score
from buildarena_benchmark.constraints import broken_constraint
from buildarena_benchmark.scorers.measures.orbits import swept
from buildarena_geometry import Machine, module_set
from buildarena_simulation import Trajectory, simulate

ROUND, RETURN = builtin_tasks()["orbit-1"], builtin_tasks()["orbit-2"]
RADIUS: Final = 600.0


def shorter(task: Task, duration_s: float, **scoring: Any) -> Task:
    """A task with less time and other thresholds."""
    return replace(
        task,
        scenario=task.scenario.model_copy(update={"duration_s": duration_s}),
        scoring=task.scoring.model_copy(update=scoring),
    )


ONCE: Final = shorter(ROUND, 32.0, cycles=1.0)


@cache
def flown(engine: str, task: str = "orbit-1") -> tuple[Machine, Trajectory]:
    machine = experts_machine(builtin_tasks()[task])
    scenario = (ONCE if task == "orbit-1" else RETURN).scenario
    return machine, simulate(machine, scenario, engine)


def bent(trial: Trajectory, arms: np.ndarray) -> Trajectory:
    """The trial on another path, given from the planet's centre, (T, 3)."""
    shift = arms - np.array([0, 0, RADIUS]) - trial.positions[: len(arms), 0]
    positions = trial.positions[: len(arms)] + shift[:, None]
    return replace(trial, positions=positions.astype(np.float32))


def arms_of(trial: Trajectory) -> np.ndarray:
    return trial.positions[:, 0].astype(float) + np.array([0, 0, RADIUS])


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_flies_round(engine) -> None:
    machine, trial = flown(engine)
    assert broken_constraint(ROUND, machine) is None
    result = score(ONCE, machine, trial)
    assert result.success
    assert result.flags == ()
    assert result.indicator == pytest.approx(60 / result.metrics["completed_s"], rel=1e-5)
    assert not score(shorter(ONCE, 32.0, cycles=3.0), machine, trial).success


def test_what_swings_to_and_fro_goes_nowhere() -> None:
    turns = np.concatenate(
        [np.linspace(0, 2, 50), np.linspace(2, -2, 100), np.linspace(-2, 0.5, 60)]
    )
    path = 640 * np.stack([np.sin(turns), 0 * turns, np.cos(turns)], axis=1)
    assert abs(swept(path, np.zeros(3))[-1]) == pytest.approx(0.5)
    around = np.linspace(0, 6 * math.pi, 200)
    path = 640 * np.stack([np.sin(around), 0 * around, np.cos(around)], axis=1)
    assert abs(swept(path, np.zeros(3))[-1]) == pytest.approx(6 * math.pi)
    assert (swept(np.zeros((4, 3)), np.zeros(3)) == 0).all()


@pytest.mark.nightly
def test_circles_over_one_place_are_no_way_round(subtests) -> None:
    for radius in [5.0, 50.0, 300.0]:
        with subtests.test(radius=radius):
            machine, trial = flown(FASTER_FIRST[0])
            around = np.linspace(0, 20 * math.pi, len(trial.time_s))
            height = math.sqrt(660**2 - radius**2)
            path = np.stack(
                [radius * np.sin(around), radius * np.cos(around), 0 * around + height], axis=1
            )
            result = score(ONCE, machine, bent(trial, path))
            assert result.metrics["cycles"] == pytest.approx(10 * (radius / 660) ** 2, rel=0.02)
            # As many units along a great circle are worth 660 / radius times as much.
            assert result.metrics["cycles"] < 10 * radius / 660


def test_rolling_and_hopping_round_is_no_flight(subtests) -> None:
    """As wheels would carry it, had it all the time of the world."""
    for height in [0.5, 5.0, 19.0]:
        with subtests.test(height=height):
            machine, trial = flown(FASTER_FIRST[0])
            arms = arms_of(trial)
            low = arms / np.linalg.norm(arms, axis=1)[:, None] * (RADIUS + height)
            result = score(ONCE, machine, bent(trial, low))
            assert (result.success, result.indicator, result.metrics["cycles"]) == (False, 0.0, 0.0)


def test_what_comes_down_on_its_way_ends_it() -> None:
    machine, trial = flown(FASTER_FIRST[0])
    arms = arms_of(trial)
    away = np.linalg.norm(arms, axis=1)
    middle = len(arms) // 2
    away[middle : middle + 3] = RADIUS + 19.9
    dipped = bent(trial, arms / np.linalg.norm(arms, axis=1)[:, None] * away[:, None])
    result = score(ONCE, machine, dipped)
    assert not result.success
    assert 0 < result.metrics["cycles"] < 1


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_comes_back_softly(engine) -> None:
    machine, trial = flown(engine, "orbit-2")
    result = score(RETURN, machine, trial)
    assert result.success
    assert result.flags == ()
    assert result.indicator == pytest.approx(60 / result.metrics["landing_s"], rel=1e-5)
    assert result.metrics["distance_to_start"] < 2
    assert result.metrics["speed_at_landing"] < 5


def landed_otherwise(change: Any) -> Any:
    """The score of the returning flight with its end changed: heights, in place, from a sample."""
    machine, trial = flown(FASTER_FIRST[0], "orbit-2")
    touch = round(score(RETURN, machine, trial).metrics["landing_s"] * 25)
    return score(RETURN, machine, change(trial, touch))


@pytest.mark.nightly
def test_what_only_hovers_over_the_ground_has_not_landed() -> None:
    def hovers(trial: Trajectory, _: int) -> Trajectory:
        bearing = trial.bearing
        assert bearing is not None
        return replace(trial, bearing=replace(bearing, ground=np.zeros_like(bearing.ground)))

    result = landed_otherwise(hovers)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly
def test_what_comes_down_hard_or_elsewhere_has_not_come_back() -> None:
    def hard(trial: Trajectory, touch: int) -> Trajectory:
        positions = trial.positions.copy()
        positions[touch + 4 :, :, 2] -= 0.4
        return replace(trial, positions=positions)

    def elsewhere(trial: Trajectory, touch: int) -> Trajectory:
        positions = trial.positions.copy()
        positions[touch - 300 :, :, 0] += 31
        positions[touch - 300 :, :, 2] -= RADIUS - math.sqrt(RADIUS**2 - 31**2)
        return replace(trial, positions=positions)

    for change in (hard, elsewhere):
        result = landed_otherwise(change)
        assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly
def test_what_comes_off_when_it_lands_is_told() -> None:
    def loses(trial: Trajectory, touch: int) -> Trajectory:
        assert trial.pieces is not None
        pieces = trial.pieces.copy()
        pieces[touch + 10 :, 2] = 2
        return replace(trial, pieces=pieces)

    result = landed_otherwise(loses)
    assert not result.success
    assert list(result.flags) == ["came_apart"]


@pytest.mark.nightly
def test_without_a_program_nothing_flies(subtests) -> None:
    for task in [ONCE, shorter(RETURN, 12.0)]:
        with subtests.test(task=task):
            machine = built(catalogue=module_set("all"))
            result = scored(task, machine, FASTER_FIRST[0], None)
            assert (result.success, result.indicator, result.metrics["cycles"]) == (False, 0.0, 0.0)


@pytest.mark.nightly
@pytest.mark.parametrize("task", [ROUND, RETURN])
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_expert_flies_in_drawn_worlds(task, engine, seed) -> None:
    result = scored(task, experts_machine(task, seed), engine, seed)
    assert result.success
    assert result.flags == ()
