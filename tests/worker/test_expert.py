"""The expert solves every built-in task; the other baselines solve none."""

from __future__ import annotations

import os

import pytest
from support.marks import nightly

from buildarena_benchmark import builtin_tasks, score
from buildarena_simulation import simulate
from buildarena_worker.session.results import Failed

TASKS = sorted(builtin_tasks())
SEEDS = range(int(os.environ.get("EXPERT_SEEDS", "1")))
ON_PYBULLET = ["flight-1", "lift-3", "support-1", "transport-1", "mechanisms-2"]
"""One task of each category; PyBullet takes several times as long, the rest is nightly."""
TRIALS = [
    (task, engine) if engine == "mujoco" or task in ON_PYBULLET else nightly(task, engine)
    for task in TASKS
    if not builtin_tasks()[task].tests  # those are in test_identify.py
    for engine in ("pybullet", "mujoco")
]


def tried(play, model: str, task: str, seed: int, engine: str):
    """The score of a model's machine, or the failure that kept it from being tried."""
    played = play(model, task=task, seed=seed)
    if played.suspended is None:
        return played.failure
    machine = played.suspended.machine
    drawn = builtin_tasks()[task].drawn(seed)
    trajectory = simulate(machine, drawn.scenario, engine, controls=played.suspended.controls)
    return score(drawn, machine, trajectory)


@pytest.mark.nightly(keep=5)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("task", "engine"), TRIALS)
def test_the_expert_succeeds(play, task, seed, engine) -> None:
    result = tried(play, "builtin/expert", task, seed, engine)
    assert not isinstance(result, Failed), result
    assert result.success, result


@pytest.mark.parametrize("model", ["builtin/random", "builtin/idle"])
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("task", TASKS)
def test_the_other_baselines_fail(play, model, task, seed) -> None:
    result = tried(play, model, task, seed, "mujoco")
    assert isinstance(result, Failed) or not result.success
