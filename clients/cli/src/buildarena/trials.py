"""Trials in notebooks: simulated locally, scored, and shown as a player."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Final

from buildarena.known_tasks import resolve_task
from buildarena.pages import FRAME_HEIGHT, Shown
from buildarena_benchmark import Score, Task
from buildarena_benchmark.environment import Evaluator, try_machine
from buildarena_benchmark.environment import Trial as TriedMachine
from buildarena_benchmark.flags import is_censored, meaning
from buildarena_geometry import Machine as GeometryMachine
from buildarena_simulation import DEFAULT_ENGINE, SimulationError, Trajectory, require_engine

PLAYER_HEIGHT: Final = FRAME_HEIGHT + 84


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """A trial of a machine; shown as a player with the score above it.

    Attributes:
        machine: Copy of the machine that was simulated.
        score: Score of the trial.
        trajectory: Trajectory of the trial; None if the machine could not be simulated.
        refusal: Reason why the machine could not be simulated; None if it was.
    """

    task: Task
    machine: GeometryMachine
    score: Score
    trajectory: Trajectory | None = None
    refusal: str | None = None

    def to_html(self) -> str:
        """Return a self-contained page that plays the trial."""
        return self._display().page()

    def save_html(self, path: str | Path) -> None:
        """Write that page into a file."""
        Path(path).write_text(self.to_html(), encoding="utf-8")

    def __repr__(self) -> str:
        return "\n".join([self._verdict(), *self._remarks()])

    def _repr_mimebundle_(self, **_asked: Any) -> dict[str, str]:
        """Return the score and a player for notebooks, or text where they show no HTML."""
        lines = "".join(f"<div>{escape(line)}</div>" for line in self._remarks())
        head = f"<div><b>{escape(self._verdict())}</b></div>{lines}"
        return {"text/plain": repr(self), "text/html": head + self._display().frame()}

    def _verdict(self) -> str:
        indicator = self.task.indicator
        shown = f"{self.score.indicator:,.2f}{indicator.suffix}"
        prefix = "at least " if is_censored(self.score.flags) else ""
        engine = "" if self.trajectory is None else f" ({self.trajectory.engine})"
        word = "success" if self.score.success else "no success"
        return f"{self.task.title}: {word}, {indicator.name} {prefix}{shown}{engine}"

    def _remarks(self) -> list[str]:
        refused = [] if self.refusal is None else [f"Not tried: {self.refusal}"]
        return refused + [f"{flag}: {meaning(flag)}" for flag in self.score.flags]

    def _display(self) -> Shown:
        simulated = self.trajectory is not None
        return Shown(
            title=self.task.title,
            machine=self.machine,
            height=PLAYER_HEIGHT if simulated else FRAME_HEIGHT,
            task=self.task if simulated else None,
            trajectory=self.trajectory,
        )


def simulate(
    machine: GeometryMachine,
    task: str | Path | Task,
    engine: str = DEFAULT_ENGINE,
    *,
    seed: int | None = None,
) -> Trial:
    """Simulate a machine in a task's trial locally, and score it.

    Args:
        task: A built-in task's name, a task file, or a task.
        engine: ``pybullet`` or ``mujoco``; by default the engine that scores jobs which name none.
        seed: Seed for the perturbed start and for the task's randomized parameters; None for the
            exact start.

    Returns:
        The trial. If the task does not allow the machine, or it can't be simulated, the trial
        contains the reason, and its score is a failure.

    Raises:
        ValueError: The task or engine is unknown.
        SimulationError: The engine failed, which is not the machine's fault.
    """
    task = resolve_task(task)
    require_engine(engine)
    copy = machine.copy()
    return _trial(task, copy, try_machine(task, copy, engine, seed=seed))


def simulate_all(
    machines: Iterable[GeometryMachine],
    task: str | Path | Task,
    engine: str = DEFAULT_ENGINE,
    *,
    seed: int | None = None,
    processes: int = 2,
) -> list[Trial]:
    """Simulate many machines in a task's trial concurrently; see `simulate`.

    Args:
        task: A built-in task's name, a task file, or a task.
        engine: ``pybullet`` or ``mujoco``; by default the engine that scores jobs which name none.
        seed: Seed of all trials; see `simulate`.
        processes: Number of concurrent trials.

    Returns:
        The trials, in the order of the machines.

    Raises:
        ValueError: The task or engine is unknown, or `processes` is less than 1.
        SimulationError: The engine failed on a machine, which is not the machine's fault. To keep
            the results of the others, use `buildarena_benchmark.environment.Evaluator`.
    """
    chosen, copies = resolve_task(task), [machine.copy() for machine in machines]
    require_engine(engine)
    trials = []
    with Evaluator(chosen, engine, seed=seed, processes=processes, trajectories=True) as evaluator:
        for number, (machine, evaluated) in enumerate(
            zip(copies, evaluator.map(copies), strict=True)
        ):
            if evaluated.trial is None:
                raise SimulationError(f"machine {number} could not be tried: {evaluated.error}")
            trials.append(_trial(chosen, machine, evaluated.trial))
    return trials


def _trial(task: Task, machine: GeometryMachine, result: TriedMachine) -> Trial:
    refusal = None if result.reason is None else f"{result.reason}: {result.detail}"
    return Trial(
        task=task,
        machine=machine,
        score=result.score,
        trajectory=result.trajectory,
        refusal=refusal,
    )
