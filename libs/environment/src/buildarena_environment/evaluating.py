"""Trials of many machines, over processes that stay warm."""

from __future__ import annotations

import json
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from queue import SimpleQueue
from typing import Any, Final, Self

from buildarena_benchmark import Task, builtin_tasks, parse_task
from buildarena_environment.choices import checked_simulator, chosen_task
from buildarena_environment.trials import Trial, try_machine
from buildarena_environment.warm_process import ProcessEndedError, WarmProcess
from buildarena_geometry import DocumentError, Machine
from buildarena_simulation import SimulationError, read_trajectory, write_trajectory

LONGEST_TRIAL_S: Final = 600.0
AHEAD: Final = 4
"""Machines of an iterable that are taken before their turn, for each process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What came of one machine of many.

    Attributes:
        trial: Its trial; None where there was none.
        error: Why there was none: the engine failed or crashed, or it took too long. It says
            nothing of the machine, and the trial may be tried again.
    """

    trial: Trial | None = None
    error: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Question:
    """What a process is asked; see `Evaluator` and `_text_of`."""

    task: str
    machine: str
    simulator: str
    seed: int | None
    whole: bool
    trajectory: bool


class Evaluator:
    """Tries machines in several processes; results do not depend on their number or order.

    Use it as a context, or close it. A machine that crashes the engine costs its own trial, and the
    process is started again.

    Args:
        task: The task, or the name of a built-in one.
        simulator: Name of the engine.
        seed: As for `Environment`.
        processes: How many; by default one for each core that this process may use.
        timeout_s: Seconds after which a trial is broken off.
        trajectories: Whether trials bring their trajectories, which is slower.
        whole: False ends each trial when it is decided, see `try_machine`.

    Raises:
        UnknownChoiceError: Task or simulator does not exist.
        TaskError: The task is not one that a file could describe.
        ValueError: A number is out of range.
    """

    def __init__(
        self,
        task: Task | str,
        simulator: str = "mujoco",
        *,
        seed: int | None = None,
        processes: int | None = None,
        timeout_s: float = LONGEST_TRIAL_S,
        trajectories: bool = False,
        whole: bool = True,
    ) -> None:
        count = len(os.sched_getaffinity(0)) if processes is None else processes
        if count < 1:
            raise ValueError(f"processes is {count}: at least one is needed")
        if not timeout_s > 0:
            raise ValueError(f"timeout_s is {timeout_s}: it must be above 0")
        self.task = chosen_task(task)
        self.simulator = checked_simulator(simulator)
        self.seed = seed
        self._timeout_s, self._trajectories, self._whole = timeout_s, trajectories, whole
        self._task_text = _text_of(self.task)
        _task_from(self._task_text)
        self._processes = [
            WarmProcess(f"trials {number + 1}", _answering) for number in range(count)
        ]
        self._free: SimpleQueue[WarmProcess] = SimpleQueue()
        for process in self._processes:
            self._free.put(process)
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="trials")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def map(self, machines: Iterable[Machine | Mapping[str, Any]]) -> Iterator[Evaluation]:
        """Tries machines.

        Args:
            machines: Machines, or their documents; taken as they are needed.

        Yields:
            One evaluation for each, in their order.

        Raises:
            DocumentError: One is not a machine.
        """
        waiting: deque[Future[Evaluation]] = deque()
        try:
            for machine in machines:
                waiting.append(self._threads.submit(self._evaluate, _document(machine)))
                if len(waiting) >= AHEAD * len(self._processes):
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()

    def evaluate(self, machine: Machine | Mapping[str, Any]) -> Evaluation:
        """Tries one machine; may be called from several threads."""
        return self._threads.submit(self._evaluate, _document(machine)).result()

    def close(self) -> None:
        """Ends the processes; trials under way are broken off."""
        for process in self._processes:
            process.close()
        self._threads.shutdown(cancel_futures=True)

    def _evaluate(self, document: str) -> Evaluation:
        process = self._free.get()
        try:
            return self._asked(process, document)
        finally:
            self._free.put(process)

    def _asked(self, process: WarmProcess, document: str) -> Evaluation:
        question = _Question(
            task=self._task_text,
            machine=document,
            simulator=self.simulator,
            seed=self.seed,
            whole=self._whole,
            trajectory=self._trajectories,
        )
        until = time.monotonic() + self._timeout_s
        try:
            answer = process.ask(question, meanwhile=partial(_require_before, until))
        except TimeoutError:
            return Evaluation(error=f"the trial took longer than {self._timeout_s:g} s")
        except ProcessEndedError as ended:
            return Evaluation(error=str(ended))
        if "error" in answer:
            return Evaluation(error=answer["error"])
        data = answer["trajectory"]
        trajectory = None if data is None else read_trajectory(data)
        return Evaluation(trial=Trial.from_document(answer["trial"], trajectory))


def _document(machine: Machine | Mapping[str, Any]) -> str:
    """A machine as text; how it came about plays no part in a trial."""
    if isinstance(machine, Machine):
        return json.dumps(machine.to_document())
    Machine.from_document(machine)
    return json.dumps(machine)


def _text_of(task: Task) -> str:
    if builtin_tasks().get(task.name) == task:
        return task.name
    return json.dumps(dict(task.as_document()))


@cache
def _task_from(text: str) -> Task:
    """The task of `_text_of`; YAML, which tasks are written in, contains JSON."""
    return builtin_tasks()[text] if text in builtin_tasks() else parse_task(text, origin="task")


def _require_before(until: float) -> None:
    if time.monotonic() > until:
        raise TimeoutError


def _answering() -> Callable[[Any], Any]:
    """What a process answers with; whatever is slow to load is loaded before the first question."""
    builtin_tasks()
    return _answered


def _answered(question: _Question) -> dict[str, Any]:
    try:
        trial = try_machine(
            _task_from(question.task),
            Machine.from_document(json.loads(question.machine)),
            question.simulator,
            seed=question.seed,
            whole=question.whole,
        )
    except (SimulationError, DocumentError) as error:
        return {"error": str(error)}
    kept = trial.trajectory if question.trajectory else None
    return {
        "trial": trial.as_document(),
        "trajectory": None if kept is None else write_trajectory(kept),
    }
