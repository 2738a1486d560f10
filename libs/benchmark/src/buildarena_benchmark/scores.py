"""Scores: one trial's verdict, and a trial that never was."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from buildarena_benchmark.scorers.measures.stability import is_unstable
from buildarena_benchmark.scorers.registry import known_scorers
from buildarena_benchmark.scorers.scorer import UNSTABLE, Metric
from buildarena_benchmark.tasks.task import Task
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory, world_of
from buildarena_simulation.trial import Decision


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What one trial of one machine is worth.

    Attributes:
        success: Whether the task's criterion is met.
        indicator: The task's figure; see `Task.indicator`.
        metrics: Parts, mass, cost and the category's secondary metrics; None where there is none.
        flags: Remarks on it; see `buildarena_benchmark.flags`.
    """

    success: bool
    indicator: float
    metrics: Mapping[str, Metric]
    flags: tuple[str, ...]


def score(task: "Task", machine: "Machine", trajectory: "Trajectory") -> Score:
    """Scores one trial, whichever simulator ran it.

    Args:
        task: The task.
        machine: The machine that was tried.
        trajectory: Its trajectory in the task's scenario.

    Returns:
        The score; a rollout that blew up is flagged `unstable` and is never a success.
    """
    scorer = known_scorers()[task.scorer]
    scenario = world_of(task.scenario, trajectory)
    verdict = scorer.judge(task.scoring, scenario, machine, trajectory)
    flags = tuple(flag.name for flag in verdict.flags)
    metrics = {**_machine_metrics(machine), **_finite(verdict.metrics)}
    if is_unstable(scenario, machine, trajectory, verdict.deciding):
        return Score(
            success=False,
            indicator=0.0,
            metrics=metrics,
            flags=(*flags, UNSTABLE.name),
        )
    return Score(
        success=verdict.success,
        indicator=verdict.indicator,
        metrics=metrics,
        flags=flags,
    )


def decision(task: "Task", *, seed: int | None = None) -> "Decision | None":
    """Tells when a running trial is decided, for those who try many machines.

    A trial that ends there has the success, indicator and flags of the whole one; metrics that tell
    of the rest (lowest height, number of broken joints) are of what was seen.

    Args:
        task: The task.
        seed: Of the trial.

    Returns:
        What `simulate` takes as `until`; None where the whole trial decides.
    """
    decide = known_scorers()[task.scorer].decision
    return decide(task.scoring, task.scenario.world(seed)) if decide else None


def failed_score(task: "Task", machine: "Machine | None" = None) -> Score:
    """The score of a machine that was never finished, or cannot be simulated.

    Args:
        task: The task.
        machine: What was built, if anything.

    Returns:
        No success and an indicator of 0; it counts in every average like any other score.
    """
    del task  # every task's failure looks the same; the argument keeps the call like `score`
    metrics = _machine_metrics(machine) if machine is not None else {}
    return Score(success=False, indicator=0.0, metrics=metrics, flags=())


def _finite(metrics: Mapping[str, Metric]) -> dict[str, Metric]:
    """Metrics of a rollout that blew up may not be numbers; they are left out as None."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in metrics.items()
    }


def _machine_metrics(machine: "Machine") -> dict[str, Metric]:
    return {
        "parts": machine.part_count,
        "mass": round(float(machine.mass), 6),
        "cost": machine.cost,
    }
