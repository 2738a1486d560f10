"""Scores: a trial's verdict, and the score of a machine without a trial."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from buildarena_benchmark.flags import meaning
from buildarena_benchmark.scoring.flags import FORCES_NOT_MEASURED, UNSTABLE
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.registry import known_scorers
from buildarena_benchmark.scoring.scorer import Metric, Score
from buildarena_benchmark.scoring.stability import is_unstable
from buildarena_benchmark.tasks.task import Task
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, simulate, world_of
from buildarena_simulation.control import PRESSES, KeyHold, read_presses, released_at
from buildarena_simulation.recording import Moment
from buildarena_simulation.trial import SAMPLES_AFTER, Decision


def score(task: "Task", machine: "Machine", trajectory: "Trajectory") -> Score:
    """Score one trial, whichever simulator ran it.

    Args:
        trajectory: Its trajectory in the task's scenario.

    Returns:
        The score; a rollout that blew up is flagged `unstable` and is never a success.
    """
    scorer = known_scorers()[task.scorer]
    scenario = world_of(task.scenario, trajectory)
    trajectory = trajectory.first(_decided(task, trajectory, scenario) + 1)
    run = Run(scenario=scenario, machine=machine, trajectory=trajectory)
    verdict = scorer.verdict(task.scoring, run)
    flags = tuple(flag.name for flag in verdict.flags)
    unstable = is_unstable(run, verdict.deciding)
    return Score(
        success=verdict.success and not unstable,
        indicator=0.0 if unstable else verdict.indicator,
        metrics={**_machine_metrics(machine), **_finite(verdict.metrics)},
        flags=(*flags, UNSTABLE.name) if unstable else flags,
    )


def explain(task: "Task", score: Score) -> str:
    """Return what happened in a trial, in words for builders and for visitors of pages.

    Returns:
        One sentence that names the figure which decided, and one for each flag; flags alone if
        the trial blew up or was not measured.
    """
    texts = [meaning(flag) for flag in score.flags]
    if not {FORCES_NOT_MEASURED.name, UNSTABLE.name} & set(score.flags):
        texts.insert(0, known_scorers()[task.scorer].explain(task.scoring, task.scenario, score))
    return " ".join(texts)


def simulate_task(
    task: "Task",
    machine: "Machine",
    engine: str,
    *,
    controls: Sequence[KeyHold] | None = None,
    seed: int | None = None,
    to_end: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a task's trial until it is decided; see `simulate`.

    Args:
        to_end: Simulate to the end instead; the score is the same.

    Raises:
        BuildarenaSimulationError: As of `simulate`.
    """
    return simulate(
        machine,
        task.scenario,
        engine,
        controls=controls,
        seed=seed,
        until=None if to_end else decision(task, seed=seed),
        on_progress=on_progress,
    )


def decision(task: "Task", *, seed: int | None = None) -> "Decision | None":
    """Return what decides one trial: its score reads no sample after that one.

    Returns:
        What `simulate` takes as `until`, for one trial; None where the whole trial decides.
    """
    return _decision(task, task.scenario.world(seed))


def _decision(task: "Task", world: Scenario) -> "Decision | None":
    decide = known_scorers()[task.scorer].decision
    return decide(task.scoring, world) if decide else None


def decided_length(task: "Task", trajectory: Trajectory, *, seed: int | None = None) -> int:
    """Return how many samples a trial has that is simulated until it is decided."""
    world = task.scenario.world(seed)
    return min(_decided(task, trajectory, world) + 1 + SAMPLES_AFTER, world.sample_count)


def _decided(task: "Task", trajectory: Trajectory, world: Scenario) -> int:
    """Return the sample that decides a trial; the last one of the scenario if none does."""
    decides = _decision(task, world)
    if decides is None:
        return world.sample_count - 1
    cargo, written = trajectory.cargo_position, trajectory.settings.get(PRESSES)
    by_keys = trajectory.piloting is None and world.control.mode == "agent"
    released_s = math.inf
    if by_keys and written is not None:
        released_s = released_at(read_presses(str(written)))
    for k, time_s in enumerate(trajectory.time_s.tolist()):
        moment = Moment(
            time_s=time_s,
            is_steered=time_s < released_s,
            cargo=None if cargo is None else cargo[k],
            positions=partial(trajectory.positions.__getitem__, k),
        )
        if k and decides(moment):
            return k
    return world.sample_count - 1


def failed_score(task: Task, machine: Machine | None = None) -> Score:  # noqa: ARG001 - as `score`
    """Return the score of a machine that was never finished, or cannot be simulated.

    Returns:
        No success and an indicator of 0; it counts in every average like any other score.
    """
    metrics = _machine_metrics(machine) if machine is not None else {}
    return Score(success=False, indicator=0.0, metrics=metrics, flags=())


def _finite(metrics: Mapping[str, Metric]) -> dict[str, Metric]:
    """Replace metrics that are not finite by None, as of a rollout that blew up."""
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
