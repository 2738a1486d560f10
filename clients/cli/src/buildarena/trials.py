"""Trials in notebooks: simulated here, scored, and shown as a player."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Final

from buildarena.known_tasks import chosen_task
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
        machine: The machine as it was then.
        score: What the trial is worth.
        trajectory: How it went; None where the machine could not be tried.
        refusal: Why it could not be tried; None where it was.
    """

    task: Task
    machine: GeometryMachine
    score: Score
    trajectory: Trajectory | None = None
    refusal: str | None = None

    def to_html(self) -> str:
        """Return a whole page that plays the trial and asks for nothing else."""
        return self._shown().page()

    def save_html(self, path: str | Path) -> None:
        """Write that page into a file."""
        Path(path).write_text(self.to_html(), encoding="utf-8")

    def __repr__(self) -> str:
        return "\n".join([self._verdict(), *self._remarks()])

    def _repr_mimebundle_(self, **_asked: Any) -> dict[str, str]:
        """Return the score and a player for notebooks, or text where they show no HTML."""
        lines = "".join(f"<div>{escape(line)}</div>" for line in self._remarks())
        head = f"<div><b>{escape(self._verdict())}</b></div>{lines}"
        return {"text/plain": repr(self), "text/html": head + self._shown().frame()}

    def _verdict(self) -> str:
        indicator = self.task.indicator
        shown = f"{self.score.indicator:,.2f}{indicator.suffix}"
        least = "at least " if is_censored(self.score.flags) else ""
        engine = "" if self.trajectory is None else f" ({self.trajectory.engine})"
        word = "success" if self.score.success else "no success"
        return f"{self.task.title}: {word}, {indicator.name} {least}{shown}{engine}"

    def _remarks(self) -> list[str]:
        refused = [] if self.refusal is None else [f"Not tried: {self.refusal}"]
        return refused + [f"{flag}: {meaning(flag)}" for flag in self.score.flags]

    def _shown(self) -> Shown:
        tried = self.trajectory is not None
        return Shown(
            title=self.task.title,
            machine=self.machine,
            height=PLAYER_HEIGHT if tried else FRAME_HEIGHT,
            task=self.task if tried else None,
            trajectory=self.trajectory,
        )


def simulate(
    machine: GeometryMachine,
    task: str | Path | Task,
    engine: str = DEFAULT_ENGINE,
    *,
    seed: int | None = None,
) -> Trial:
    """Put a machine through a task's trial, here, and score it.

    Args:
        task: A built-in task's name, a task file, or a task.
        engine: ``pybullet`` or ``mujoco``; by default the one that scores jobs which name none.
        seed: Varies the start a little, as a fair repetition would, and draws what the task leaves
            to it; None for the exact one.

    Returns:
        The trial. One of a machine that the task does not allow, or that can't be simulated,
        says why, and its score is a failure.

    Raises:
        ValueError: There is no such task or engine.
        SimulationError: The engine failed, which is not the machine's fault.
    """
    chosen = chosen_task(task)
    require_engine(engine)
    copy = machine.copy()
    return _shown_trial(chosen, copy, try_machine(chosen, copy, engine, seed=seed))


def simulate_all(
    machines: Iterable[GeometryMachine],
    task: str | Path | Task,
    engine: str = DEFAULT_ENGINE,
    *,
    seed: int | None = None,
    processes: int = 2,
) -> list[Trial]:
    """Put many machines through a task's trial, some at once; see `simulate`.

    Args:
        task: A built-in task's name, a task file, or a task.
        engine: ``pybullet`` or ``mujoco``; by default the one that scores jobs which name none.
        seed: As in `simulate`, the same for all.
        processes: Trials at once.

    Returns:
        Their trials, in the order of the machines, whichever was done first.

    Raises:
        ValueError: There is no such task or engine, or there are fewer processes than one.
        SimulationError: The engine failed on a machine, which is not the machine's fault. To keep
            the results of the others, use `buildarena_benchmark.environment.Evaluator`.
    """
    chosen, copies = chosen_task(task), [machine.copy() for machine in machines]
    require_engine(engine)
    trials = []
    with Evaluator(chosen, engine, seed=seed, processes=processes, trajectories=True) as evaluator:
        for number, (machine, evaluated) in enumerate(
            zip(copies, evaluator.map(copies), strict=True)
        ):
            if evaluated.trial is None:
                raise SimulationError(f"machine {number} could not be tried: {evaluated.error}")
            trials.append(_shown_trial(chosen, machine, evaluated.trial))
    return trials


def _shown_trial(task: Task, machine: GeometryMachine, tried: TriedMachine) -> Trial:
    refusal = None if tried.reason is None else f"{tried.reason}: {tried.detail}"
    return Trial(
        task=task,
        machine=machine,
        score=tried.score,
        trajectory=tried.trajectory,
        refusal=refusal,
    )
