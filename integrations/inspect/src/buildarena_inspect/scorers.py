"""Scorers: what the benchmark's own scorers say of the trial that counts."""

from __future__ import annotations

from hashlib import sha256
from typing import Any, Final

from inspect_ai.scorer import CORRECT, INCORRECT, Score, Scorer, Target, accuracy, mean, scorer
from inspect_ai.solver import TaskState

from buildarena_benchmark.environment import Trial
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_benchmark.flags import is_disqualified
from buildarena_geometry import Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_inspect.building import Building, building_of
from buildarena_inspect.metrics import indicator_by_task, mean_rank, named, success_interval
from buildarena_inspect.versions import result_versions

SUCCESS: Final = "success"
INDICATOR: Final = "indicator"
REWARD: Final = "reward"


@scorer(metrics=[accuracy(), success_interval()])
def success() -> Scorer:
    """Whether the machine met the task's criterion and no flag disqualifies it."""

    async def score(state: TaskState, target: Target) -> Score:
        del target  # a task's criterion stands in its file
        building = building_of(state)
        trial = await building.ended()
        return Score(
            value=CORRECT if trial.counts else INCORRECT,
            explanation=trial.detail or score_text(building.environment.task, trial.score),
            metadata=described(building, trial),
        )

    return score


@scorer(metrics=[indicator_by_task(), mean_rank()])
def indicator() -> Scorer:
    """The task's figure; 0 where a flag disqualifies the trial, as in our rankings."""

    async def score(state: TaskState, target: Target) -> Score:
        del target
        building = building_of(state)
        trial = await building.ended()
        figure = building.environment.task.indicator
        return Score(
            value=counted_indicator(trial),
            explanation=named(figure.name, figure.unit),
            metadata={
                "task": building.conditions.task,
                "indicator": figure.name,
                "unit": figure.unit,
                "success": trial.counts,
                "flags": list(trial.score.flags),
            },
        )

    return score


@scorer(metrics=[mean()])
def reward() -> Scorer:
    """What the episode is worth by the rewards that the task was given."""

    async def score(state: TaskState, target: Target) -> Score:
        del target
        building = building_of(state)
        await building.ended()
        weights = dict(building.environment.weights)
        return Score(value=building.environment.reward, metadata={"weights": weights})

    return score


def counted_indicator(trial: Trial) -> float:
    """A trial's indicator as our rankings count it."""
    return 0.0 if is_disqualified(trial.score.flags) else trial.score.indicator


def described(building: Building, trial: Trial) -> dict[str, Any]:
    """All figures of a trial, with the versions of everything that can change them."""
    environment = building.environment
    machine = building.machine
    return {
        "task": environment.task.name,
        "task_version": environment.task.version,
        "simulator": environment.simulator,
        **result_versions(environment.simulator),
        "seed": environment.seed,
        "success": trial.score.success,
        "indicator": trial.score.indicator,
        "unit": environment.task.indicator.unit,
        "metrics": dict(trial.score.metrics),
        "flags": list(trial.score.flags),
        "disqualified": is_disqualified(trial.score.flags),
        "reason": trial.reason,
        "trials": len(environment.trials),
        "machine_hash": None if machine is None else machine_hash(machine),
    }


def machine_hash(machine: Machine) -> str:
    """The hash by which the service keeps a machine's document."""
    return sha256(machine_bytes(machine)).hexdigest()
