"""Scorers: what the benchmark's own scorers say of the trial that counts."""

from __future__ import annotations

from hashlib import sha256
from typing import Any, Final

import numpy as np
from inspect_ai.scorer import (
    CORRECT,
    INCORRECT,
    Metric,
    SampleScore,
    Score,
    Scorer,
    Target,
    Value,
    accuracy,
    mean,
    metric,
    scorer,
    value_to_float,
)
from inspect_ai.solver import TaskState

from buildarena_benchmark.environment import Trial, references
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_benchmark.flags import is_disqualified
from buildarena_benchmark.statistics import mean_interval, mean_ranks, wilson_interval
from buildarena_geometry import Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_inspect.building import Building, building_of
from buildarena_inspect.versions import result_versions

DIGITS: Final = 4
"""References have so many; more would make equal figures differ."""


def named(indicator: str, unit: str) -> str:
    """An indicator with its unit in brackets; a ratio has none."""
    return indicator if unit == "1" else f"{indicator} ({unit})"


@metric(scores="unreduced")
def success_interval() -> Metric:
    """The 95 % Wilson interval of the success rate; each epoch is a trial."""
    to_float = value_to_float()

    def compute(scores: list[SampleScore]) -> Value:
        if not scores:
            return {}
        low, high = wilson_interval(
            sum(to_float(found.score.value) == 1.0 for found in scores), len(scores)
        )
        return {"wilson_low": low, "wilson_high": high}

    return compute


@metric(scores="unreduced")
def indicator_by_task() -> Metric:
    """The mean indicator of each task, named with its unit, and its 95 % interval if it has one.

    Tasks have different units, so there is no mean over tasks.
    """

    def compute(scores: list[SampleScore]) -> Value:
        told: dict[str, float] = {}
        for task, found in _by_task(scores).items():
            about = found[0].score.metadata or {}
            values = np.array([one.score.as_float() for one in found])
            won = np.array([bool((one.score.metadata or {})["success"]) for one in found])
            name = f"{task} {named(about['indicator'], about['unit'])}"
            told[name] = float(values.mean())
            interval = mean_interval(values, won)
            if interval is not None:
                told[f"{name} low"], told[f"{name} high"] = interval
        return dict(told)

    return compute


@metric(scores="unreduced")
def mean_rank() -> Metric:
    """Mean rank over tasks and both figures, beside the built-in expert: 1 is better in all.

    1.5 is as good, 2 is behind in everything. It is the leaderboards' rank aggregation; models of
    several logs are ranked by a service that they are brought into.
    """

    def compute(scores: list[SampleScore]) -> Value:
        known = references()
        tasks = [task for task in _by_task(scores) if task in known]
        if not tasks:
            return {}
        found = _by_task(scores)
        rates = [[_rate(found[task]), 1.0] for task in tasks]
        figures = [[round(_mean(found[task]), DIGITS), known[task]] for task in tasks]
        return {"mean_rank": float(mean_ranks(np.array(rates), np.array(figures))[0])}

    return compute


def _by_task(scores: list[SampleScore]) -> dict[str, list[SampleScore]]:
    tasks: dict[str, list[SampleScore]] = {}
    for found in scores:
        tasks.setdefault(str((found.score.metadata or {})["task"]), []).append(found)
    return tasks


def _rate(scores: list[SampleScore]) -> float:
    return float(np.mean([bool((found.score.metadata or {})["success"]) for found in scores]))


def _mean(scores: list[SampleScore]) -> float:
    return float(np.mean([found.score.as_float() for found in scores]))


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
