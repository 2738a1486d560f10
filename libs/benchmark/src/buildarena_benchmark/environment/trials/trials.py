"""A trial of a machine, from the task's constraints to its score."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, Self

import numpy as np

from buildarena_benchmark import Score, Task, broken_constraint, failed_score, score
from buildarena_benchmark.flags import is_disqualified
from buildarena_benchmark.scores import explain, simulate_task
from buildarena_benchmark.scoring.measures.series import tilt_deg
from buildarena_geometry import Machine
from buildarena_simulation import DEFAULT_ENGINE, MachineNotSimulable, Trajectory

TOPPLED_DEG: Final = 60.0
"""A starting block that leans by more has toppled, degrees. Ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Result of a machine's trial.

    Attributes:
        reason: Class of the broken constraint, or the kind of `MachineNotSimulable`:
            ``not_simulable``, ``controller_failed``; None if it was simulated.
        detail: The reason in a sentence; "" if it was simulated.
        wall_s: Duration, seconds.
    """

    score: Score
    reason: str | None = None
    detail: str = ""
    wall_s: float = 0.0
    trajectory: Trajectory | None = None

    @property
    def counts(self) -> bool:
        """True if it is a success in our ranking: met the criterion, and not disqualified."""
        return self.score.success and not is_disqualified(self.score.flags)

    def as_document(self) -> dict[str, Any]:
        """Return JSON values that `from_document` reads; without the trajectory."""
        return {
            "success": self.score.success,
            "indicator": self.score.indicator,
            "metrics": dict(self.score.metrics),
            "flags": list(self.score.flags),
            "reason": self.reason,
            "detail": self.detail,
            "wall_s": self.wall_s,
        }

    @classmethod
    def from_document(
        cls, document: Mapping[str, Any], trajectory: Trajectory | None = None
    ) -> Self:
        """Return a trial from `as_document`."""
        measured = Score(
            success=bool(document["success"]),
            indicator=float(document["indicator"]),
            metrics=dict(document["metrics"]),
            flags=tuple(document["flags"]),
        )
        return cls(
            score=measured,
            reason=document["reason"],
            detail=document["detail"],
            wall_s=float(document["wall_s"]),
            trajectory=trajectory,
        )


class TrialRunner(Protocol):
    """Runner of trials: `try_machine`, or one that works elsewhere."""

    def __call__(
        self, task: Task, machine: Machine, simulator: str, /, *, seed: int | None
    ) -> Trial:
        """Try a machine like `try_machine`."""
        ...


def try_machine(
    task: Task,
    machine: Machine,
    simulator: str = DEFAULT_ENGINE,
    *,
    seed: int | None = None,
    to_end: bool = False,
) -> Trial:
    """Check a machine by the task's constraints, and simulate and score it.

    Args:
        simulator: Name of the engine, see `buildarena_simulation.ENGINES`.
        seed: Varies the start as a fair repetition would; None for the exact one of the service.

    Raises:
        SimulationError: The simulator failed; the machine may be fine.
    """
    started = time.perf_counter()
    broken = broken_constraint(task, machine)
    if broken is None:
        try:
            trajectory = simulate_task(task, machine, simulator, seed=seed, to_end=to_end)
        except MachineNotSimulable as refusal:
            broken = refusal.kind, refusal.reason
        else:
            measured, wall_s = score(task, machine, trajectory), time.perf_counter() - started
            return Trial(score=measured, wall_s=wall_s, trajectory=trajectory)
    return Trial(
        score=failed_score(task, machine),
        reason=broken[0],
        detail=broken[1],
        wall_s=time.perf_counter() - started,
    )


def counted_trial(task: Task, trials: Sequence[Trial]) -> Trial:
    """Return the one that counts: the best, or the last where the others are test trials.

    The best is as the service chooses it: a success before none, one that no flag disqualifies
    before others, then the larger indicator, then the first.
    """
    if task.test_trials:
        return trials[-1]
    return max(trials, key=lambda trial: (trial.counts, trial.score.success, trial.score.indicator))


def score_text(task: Task, score: Score, trajectory: Trajectory | None = None) -> str:
    """Return a trial's score in words, for models: the request, the measurements, the events."""
    indicator = task.indicator
    succeeded = score.success and not is_disqualified(score.flags)
    parts = [
        "It succeeded." if succeeded else "It did not succeed.",
        explain(task, score),
        f"{indicator.name.capitalize()}: {score.indicator:.2f}{indicator.suffix}.",
    ]
    measured = [
        f"{name} {_format(value)}" for name, value in score.metrics.items() if value is not None
    ]
    if measured:
        parts.append("Measured: " + ", ".join(measured) + ".")
    if score.flags:
        parts.append(f"Flags: {', '.join(score.flags)}.")
    return " ".join([*parts, *_describe_events(trajectory)])


def _describe_events(trajectory: Trajectory | None) -> Iterator[str]:
    """Describe the first thing that broke, and a machine that toppled."""
    if trajectory is None:
        return
    if trajectory.breaks:
        first, count = trajectory.breaks[0], len(trajectory.breaks)
        yield f"First to break: {first.joint} ({first.kind}) at {first.time_s:.2f} s, of {count}."
    tilt = tilt_deg(trajectory, 0)
    toppled = np.flatnonzero(tilt > TOPPLED_DEG)
    if len(toppled):
        yield (
            f"It toppled: from {trajectory.time_s[toppled[0]]:.2f} s on the starting block leaned "
            f"by more than {TOPPLED_DEG:g}°, at the end by {tilt[-1]:.0f}°."
        )


def _format(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
