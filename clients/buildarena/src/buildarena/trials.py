"""Trials in notebooks: simulated here, scored, and shown as a player."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from html import escape
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from buildarena.known_tasks import chosen_task
from buildarena.pages import FRAME_HEIGHT, Shown
from buildarena_benchmark import Score, Task, broken_constraint, failed_score, score
from buildarena_benchmark.flags import is_censored, meaning
from buildarena_geometry import Machine as GeometryMachine
from buildarena_simulation import (
    ENGINES,
    MachineNotSimulable,
    Scenario,
    Trajectory,
    read_trajectory,
    write_trajectory,
)
from buildarena_simulation import simulate as simulate_here

PLAYER_HEIGHT: Final = FRAME_HEIGHT + 84


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """A trial of a machine; shown as a player with the score above it.

    Attributes:
        task: What the machine was put through.
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
        """A whole page that plays the trial and asks for nothing else."""
        return self._shown().page()

    def save_html(self, path: str | Path) -> None:
        """Writes that page into a file."""
        Path(path).write_text(self.to_html(), encoding="utf-8")

    def __repr__(self) -> str:
        return "\n".join([self._verdict(), *self._remarks()])

    def _repr_mimebundle_(self, **_asked: Any) -> dict[str, str]:
        """What notebooks show: the score and a player, or text where they show no HTML."""
        lines = "".join(f"<div>{escape(line)}</div>" for line in self._remarks())
        head = f"<div><b>{escape(self._verdict())}</b></div>{lines}"
        return {"text/plain": repr(self), "text/html": head + self._shown().frame()}

    def _verdict(self) -> str:
        figure, unit = self.task.indicator.name, self.task.indicator.unit
        shown = f"{self.score.indicator:,.2f}" + ("" if unit == "1" else f" {unit}")
        least = "at least " if is_censored(self.score.flags) else ""
        engine = "" if self.trajectory is None else f" ({self.trajectory.engine})"
        word = "success" if self.score.success else "no success"
        return f"{self.task.title}: {word}, {figure} {least}{shown}{engine}"

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
    engine: str = "mujoco",
    *,
    seed: int | None = None,
) -> Trial:
    """Puts a machine through a task's trial, here, and scores it.

    Args:
        machine: The machine.
        task: A built-in task's name, a task file, or a task.
        engine: ``mujoco`` or ``pybullet``.
        seed: Varies the start a little, as a fair repetition would; None for the exact one.

    Returns:
        The trial. One of a machine that the task does not allow, or that can't be simulated,
        says why, and its score is a failure.

    Raises:
        ValueError: There is no such task or engine.
    """
    chosen = chosen_task(task)
    _check_engine(engine)
    copy = machine.copy()
    why = _broken(chosen, copy)
    tried = _tried(copy, chosen.scenario, engine, seed) if why is None else why
    return _judged(chosen, copy, tried)


def simulate_all(
    machines: Iterable[GeometryMachine],
    task: str | Path | Task,
    engine: str = "mujoco",
    *,
    seed: int | None = None,
    processes: int = 2,
) -> list[Trial]:
    """Puts many machines through a task's trial, some at once; see `simulate`.

    Args:
        machines: The machines.
        task: A built-in task's name, a task file, or a task.
        engine: ``mujoco`` or ``pybullet``.
        seed: As in `simulate`, the same for all.
        processes: Trials at once.

    Returns:
        Their trials, in the order of the machines, whichever was done first.

    Raises:
        ValueError: There is no such task or engine, or there are fewer processes than one.
    """
    if processes < 1:
        raise ValueError(f"processes is {processes}; at least 1 is needed")
    chosen, copies = chosen_task(task), [machine.copy() for machine in machines]
    _check_engine(engine)
    broken = [_broken(chosen, machine) for machine in copies]
    work = partial(
        _tried_elsewhere, scenario=chosen.scenario.model_dump_json(), engine=engine, seed=seed
    )
    documents = [
        machine.to_document() for machine, why in zip(copies, broken, strict=True) if why is None
    ]
    results = iter(_mapped(work, documents, processes))
    return [
        _judged(chosen, machine, next(results) if why is None else why)
        for machine, why in zip(copies, broken, strict=True)
    ]


def _mapped(
    work: Callable[[object], bytes | str], documents: Sequence[object], processes: int
) -> list[bytes | str]:
    if processes == 1 or len(documents) < 2:  # noqa: PLR2004 - one trial has nothing beside it
        return list(map(work, documents))
    # Notebooks have threads of their own, which a forked process would be left without.
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        return list(pool.map(work, documents))


def _tried_elsewhere(
    document: object, *, scenario: str, engine: str, seed: int | None
) -> bytes | str:
    """A trajectory's file, or why there is none: what goes from one process to another."""
    machine = GeometryMachine.from_document(document)
    tried = _tried(machine, Scenario.model_validate_json(scenario), engine, seed)
    return tried if isinstance(tried, str) else write_trajectory(tried)


def _tried(
    machine: GeometryMachine, scenario: Scenario, engine: str, seed: int | None
) -> Trajectory | str:
    try:
        return simulate_here(machine, scenario, engine, seed=seed)
    except MachineNotSimulable as failure:
        return str(failure.reason)


def _broken(task: Task, machine: GeometryMachine) -> str | None:
    """What of a task a machine breaks, in words."""
    broken = broken_constraint(task, machine)
    return None if broken is None else f"{broken[0]}: {broken[1]}"


def _judged(task: Task, machine: GeometryMachine, tried: Trajectory | bytes | str) -> Trial:
    if isinstance(tried, str):
        return Trial(task=task, machine=machine, score=failed_score(task, machine), refusal=tried)
    trajectory = read_trajectory(tried) if isinstance(tried, bytes) else tried
    result = score(task, machine, trajectory)
    return Trial(task=task, machine=machine, score=result, trajectory=trajectory)


def _check_engine(engine: str) -> None:
    if engine not in ENGINES:
        raise ValueError(f"no engine {engine!r}; there are {', '.join(ENGINES)}")
