"""Scorers, which use the benchmark's scores of the trial that counts."""

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
from buildarena_inspect.metrics import indicator_by_task, mean_rank, success_interval, with_unit
from buildarena_inspect.versions import result_versions

SUCCESS: Final = "success"
INDICATOR: Final = "indicator"


@scorer(metrics=[accuracy(), success_interval()])
def success() -> Scorer:
    """Score whether the machine met the task's criterion without a disqualifying flag."""

    async def score(state: TaskState, target: Target) -> Score:
        del target  # a task's criterion is in its file
        building = building_of(state)
        trial = await building.ended()
        return Score(
            value=CORRECT if trial.counts else INCORRECT,
            explanation=trial.detail or score_text(building.environment.task, trial.score),
            metadata=describe(building, trial),
        )

    return score


@scorer(metrics=[indicator_by_task(), mean_rank()])
def indicator() -> Scorer:
    """Score the task's indicator; 0 for a disqualified trial, as in BuildArena's rankings."""

    async def score(state: TaskState, target: Target) -> Score:
        del target
        building = building_of(state)
        trial = await building.ended()
        figure = building.environment.task.indicator
        return Score(
            value=0.0 if is_disqualified(trial.score.flags) else trial.score.indicator,
            explanation=with_unit(figure.name, figure.unit),
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
    """Score the episode by the rewards of the task."""

    async def score(state: TaskState, target: Target) -> Score:
        del target
        building = building_of(state)
        await building.ended()
        weights = dict(building.environment.weights)
        return Score(value=building.environment.reward, metadata={"weights": weights})

    return score


def describe(building: Building, trial: Trial) -> dict[str, Any]:
    """Return all figures of a trial, with the versions that determine them."""
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
    """Return the hash by which the service stores a machine's document."""
    return sha256(machine_bytes(machine)).hexdigest()
