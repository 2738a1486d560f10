"""What a builder reads of a trial: what was asked, what was measured, and what happened."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.references import load_machine

from buildarena_benchmark import Score, builtin_tasks
from buildarena_benchmark.flags import meaning
from buildarena_environment.trials import TOPPLED_DEG, score_text, try_machine

FAILED = Score(success=False, indicator=0.25, metrics={}, flags=())


@pytest.mark.parametrize("name", sorted(builtin_tasks()))
def test_a_failure_names_every_threshold_of_its_scorer(name):
    task = builtin_tasks()[name]
    text = score_text(task, FAILED)
    for parameter, value in task.scoring.model_dump(mode="json").items():
        if isinstance(value, int | float) and not isinstance(value, bool) and value:
            assert f"{parameter.replace('_', ' ')} {value:g}" in text
    # Where a trial looks for progress is no threshold.
    assert "target" not in text
    assert "0.25" in text
    assert ": 0.25 1." not in text, "a ratio has no unit"
    assert "Criterion" not in score_text(task, replace(FAILED, success=True))


def test_a_success_that_a_flag_disqualifies_is_none():
    flagged = replace(FAILED, success=True, flags=("start_too_high",))
    text = score_text(builtin_tasks()["lift-2"], flagged)
    assert text.startswith("It did not succeed.")
    assert meaning("start_too_high") in text


@pytest.fixture(scope="module")
def driven():
    task = builtin_tasks()["transport-1"]
    return task, try_machine(task, load_machine("car-without-keys"), "mujoco")


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0.6, 0.8, 0)])
@pytest.mark.parametrize("degrees", [30.0, 59.0, 61.0, 90.0, 180.0])
def test_toppling_is_told_from_the_starting_blocks_lean(driven, axis, degrees):
    task, trial = driven
    times = trial.trajectory.time_s
    turned = trial.trajectory.quaternions.copy()
    half = np.radians(degrees) / 2
    lean = np.array([np.cos(half), *(np.sin(half) * np.array(axis))])
    from_s = 10
    turned[from_s:, 0] = lean
    turned[:from_s, 0] = (1, 0, 0, 0)
    text = score_text(task, trial.score, replace(trial.trajectory, quaternions=turned))
    assert ("It toppled" in text) == (degrees > TOPPLED_DEG)
    if degrees > TOPPLED_DEG:
        assert f"from {times[from_s]:.2f} s on" in text
        assert f"by {degrees:.0f}°" in text


@pytest.mark.parametrize("degrees", [45.0, 90.0, 180.0])
def test_a_turn_on_the_spot_is_no_toppling(driven, degrees):
    task, trial = driven
    turned = trial.trajectory.quaternions.copy()
    half = np.radians(degrees) / 2
    turned[:, 0] = (1, 0, 0, 0)
    turned[5:, 0] = (np.cos(half), 0, 0, np.sin(half))
    text = score_text(task, trial.score, replace(trial.trajectory, quaternions=turned))
    assert "toppled" not in text


def test_the_first_break_is_told():
    task = builtin_tasks()["support-1"]
    trial = try_machine(task, load_machine("beam"), "mujoco")
    first = trial.trajectory.breaks[0]
    text = score_text(task, trial.score, trial.trajectory)
    assert f"First to break: {first.joint}" in text
    assert "First to break" not in score_text(task, trial.score)
