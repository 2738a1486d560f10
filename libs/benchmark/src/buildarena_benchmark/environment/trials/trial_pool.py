"""Processes that stay warm and try machines of any task; one that dies costs its trial only."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from queue import SimpleQueue
from typing import Any, Final, NamedTuple, Self

from buildarena_benchmark import Task, builtin_tasks, parse_task
from buildarena_benchmark.environment.options import is_builtin
from buildarena_benchmark.environment.trials.trials import Trial, try_machine
from buildarena_benchmark.environment.trials.warm_process import ProcessEndedError, WarmProcess
from buildarena_benchmark.scores import simulate_task
from buildarena_geometry import DocumentError, KeyPress, Machine
from buildarena_simulation import (
    DEFAULT_ENGINE,
    MachineNotSimulable,
    SimulationError,
    Trajectory,
    read_trajectory,
    write_trajectory,
)

LONGEST_TRIAL_S: Final = 600.0
TASKS_READ: Final = 64
"""Tasks that a process remembers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Result of one machine of many.

    Attributes:
        trial: Its trial; None where there was none.
        error: Reason for a missing score: the engine failed, crashed or timed out. It says nothing
            about the machine, and the trial may be repeated.
    """

    trial: Trial | None = None
    error: str = ""


class WrittenTask(NamedTuple):
    """A task as another process can read it.

    Attributes:
        text: Its name if it is a built-in one, otherwise its file.
        seed: Seed of the task's random numbers; None where it has none.
    """

    text: str
    seed: int | None

    @classmethod
    def of(cls, task: Task) -> WrittenTask:
        """Return a task in its written form."""
        text = task.name if is_builtin(task) else json.dumps(dict(task.as_document()))
        return cls(text, task.seed if task.seed or task.hidden_parameters is not None else None)

    def parse(self) -> Task:
        """Return the task.

        Raises:
            TaskError: It is not one that a file could describe.
        """
        return _parse_task(self)


@lru_cache(maxsize=TASKS_READ)
def _parse_task(written: WrittenTask) -> Task:
    builtin = builtin_tasks().get(written.text)
    # YAML, which tasks are written in, contains JSON.
    task = parse_task(written.text, origin="task") if builtin is None else builtin
    return task if written.seed is None else task.with_seed(written.seed)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Question:
    """Question to a process in documents, as tasks and machines cannot be pickled.

    See `TrialPool.submit`; without `scored`, the machine is only simulated.
    """

    task: WrittenTask
    machine: str
    simulator: str
    seed: int | None = None
    to_end: bool = False
    trajectory: bool = True
    scored: bool = True
    controls: Sequence[KeyPress] | None = None


class TrialPool:
    """Pool of processes that try machines, shared by environments of any tasks.

    Its `try_machine` takes the place of the module's in an `Environment`: a machine that crashes
    the engine then costs its own trial, not the program. Processes start with the first trials.
    Use it as a context, or close it.

    Args:
        processes: Number of processes; by default one for each core that this process may use.
        timeout_s: Time limit of a trial, seconds.
        trajectories: Whether trials contain their trajectories, which is slower.
        to_end: False ends each trial when it is decided, see `try_machine`.

    Raises:
        ValueError: A number is out of range.
    """

    def __init__(
        self,
        processes: int | None = None,
        *,
        timeout_s: float = LONGEST_TRIAL_S,
        trajectories: bool = False,
        to_end: bool = False,
        name: str = "trials",
    ) -> None:
        count = len(os.sched_getaffinity(0)) if processes is None else processes
        if count < 1:
            raise ValueError(f"processes is {count}: at least one is needed")
        if not timeout_s > 0:
            raise ValueError(f"timeout_s is {timeout_s}: it must be above 0")
        self._timeout_s, self._trajectories, self._to_end = timeout_s, trajectories, to_end
        numbers = [f" {number + 1}" for number in range(count)] if count > 1 else [""]
        self.processes = [WarmProcess(name + number, _prepare_answers) for number in numbers]
        self._free: SimpleQueue[WarmProcess] = SimpleQueue()
        for process in self.processes:
            self._free.put(process)
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="trials")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Start the processes, so that the first trials find them warm."""
        for process in self.processes:
            process.start()

    def simulate(
        self,
        task: Task,
        machine: Machine,
        simulator: str,
        *,
        controls: Sequence[KeyPress] | None = None,
        seed: int | None = None,
        meanwhile: Callable[[], object] = lambda: None,
    ) -> Trajectory:
        """Simulate like `buildarena_simulation.simulate`, in one of the processes; wait for it.

        Args:
            task: The task with the scenario; the trial is not scored.
            controls: Key presses of this run; None for the machine's own.
            seed: Seed of a varied world; None for the exact one.
            meanwhile: Called every now and then; an exception from it ends the trial.

        Raises:
            MachineNotSimulable: The engine can't take the machine.
            SimulationError: The engine failed; the machine may be fine.
            ProcessEndedError: The engine ended its process.
        """
        question = _Question(
            task=WrittenTask.of(task),
            machine=json.dumps(machine.to_document()),
            simulator=simulator,
            scored=False,
            controls=controls,
            seed=seed,
        )
        process = self._free.get()
        try:
            outcome = process.ask(question, meanwhile=meanwhile)
        finally:
            self._free.put(process)
        if isinstance(outcome, Exception):
            raise outcome
        simulated: Trajectory = outcome
        return simulated

    def submit(
        self, task: Task, document: str, simulator: str, seed: int | None = None
    ) -> Future[Evaluation]:
        """Have a machine tried when its turn comes.

        Args:
            task: A task that a file could describe.
        """
        question = _Question(
            task=WrittenTask.of(task),
            machine=document,
            simulator=simulator,
            seed=seed,
            to_end=self._to_end,
            trajectory=self._trajectories,
        )
        return self._threads.submit(self._evaluate, question)

    def try_machine(
        self,
        task: Task,
        machine: Machine,
        simulator: str = DEFAULT_ENGINE,
        *,
        seed: int | None = None,
    ) -> Trial:
        """Try a machine like `environment.try_machine`, in one of the processes; wait for it.

        Raises:
            SimulationError: The engine failed or crashed, or the trial took too long.
        """
        document = json.dumps(machine.to_document())
        evaluation = self.submit(task, document, simulator, seed).result()
        if evaluation.trial is None:
            raise SimulationError(evaluation.error)
        return evaluation.trial

    def close(self) -> None:
        """End the processes; trials under way are broken off."""
        # Waiting work must not restart a process that was just ended.
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._end_processes()
        self._threads.shutdown()
        self._end_processes()

    def _end_processes(self) -> None:
        for process in self.processes:
            process.close()

    def _evaluate(self, question: _Question) -> Evaluation:
        process = self._free.get()
        until = time.monotonic() + self._timeout_s
        try:
            answer = process.ask(question, meanwhile=partial(_require_before, until))
        except TimeoutError:
            return Evaluation(error=f"the trial took longer than {self._timeout_s:g} s")
        except ProcessEndedError as ended:
            return Evaluation(error=str(ended))
        finally:
            self._free.put(process)
        if "error" in answer:
            return Evaluation(error=answer["error"])
        data = answer["trajectory"]
        trajectory = None if data is None else read_trajectory(data)
        return Evaluation(trial=Trial.from_document(answer["trial"], trajectory))


def _require_before(until: float) -> None:
    if time.monotonic() > until:
        raise TimeoutError


def _prepare_answers() -> Callable[[Any], Any]:
    """Return a process's function for questions, once whatever is slow to load is loaded."""
    builtin_tasks()
    return _answer


def _answer(question: _Question) -> Any:
    task = question.task.parse()
    if not question.scored:
        return _simulate(task, question)
    try:
        trial = try_machine(
            task,
            Machine.from_document(json.loads(question.machine)),
            question.simulator,
            seed=question.seed,
            to_end=question.to_end,
        )
    except (SimulationError, DocumentError) as error:
        return {"error": str(error)}
    trajectory = trial.trajectory if question.trajectory else None
    return {
        "trial": trial.as_document(),
        "trajectory": None if trajectory is None else write_trajectory(trajectory),
    }


def _simulate(task: Task, question: _Question) -> Trajectory | Exception:
    machine = Machine.from_document(json.loads(question.machine))
    try:
        return simulate_task(
            task, machine, question.simulator, controls=question.controls, seed=question.seed
        )
    except (MachineNotSimulable, SimulationError) as error:
        return error
