"""Trials of many machines, over processes that stay warm."""

import json
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future
from typing import Any, Final

from buildarena_benchmark import Task
from buildarena_benchmark.environment.options import checked_simulator, resolve_task
from buildarena_benchmark.environment.trials.trial_pool import (
    LONGEST_TRIAL_S,
    Evaluation,
    TrialPool,
    WrittenTask,
)
from buildarena_geometry import Machine
from buildarena_simulation import DEFAULT_ENGINE

AHEAD: Final = 4
"""Machines of an iterable that are taken before their turn, for each process."""


class Evaluator(TrialPool):
    """Evaluator of machines in several processes; results do not depend on their number or order.

    Use it as a context, or close it. A machine that crashes the engine costs its own trial, and the
    process is started again.

    Args:
        task: The task, or the name of a built-in one.
        processes: Number of processes; by default one for each core that this process may use.
        timeout_s: Time limit of a trial, seconds.
        trajectories: Whether trials contain their trajectories, which is slower.
        to_end: False ends each trial when it is decided, see `try_machine`.

    Raises:
        UnknownChoiceError: Task or simulator does not exist.
        TaskError: The task is not one that a file could describe.
        ValueError: A number is out of range.
    """

    def __init__(
        self,
        task: Task | str,
        simulator: str = DEFAULT_ENGINE,
        *,
        seed: int | None = None,
        processes: int | None = None,
        timeout_s: float = LONGEST_TRIAL_S,
        trajectories: bool = False,
        to_end: bool = False,
    ) -> None:
        self.task = resolve_task(task)
        self.simulator = checked_simulator(simulator)
        self.seed = seed
        WrittenTask.of(self.task).parse()
        super().__init__(processes, timeout_s=timeout_s, trajectories=trajectories, to_end=to_end)

    def map(self, machines: Iterable[Machine | Mapping[str, Any]]) -> Iterator[Evaluation]:
        """Try machines.

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
                waiting.append(self._submit(machine))
                if len(waiting) >= AHEAD * len(self.processes):
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()

    def evaluate(self, machine: Machine | Mapping[str, Any]) -> Evaluation:
        """Try one machine; may be called from several threads."""
        return self._submit(machine).result()

    def _submit(self, machine: Machine | Mapping[str, Any]) -> Future[Evaluation]:
        return self.submit(self.task, _document(machine), self.simulator, self.seed)


def _document(machine: Machine | Mapping[str, Any]) -> str:
    """Return a machine as text; how it came about plays no part in a trial."""
    if isinstance(machine, Machine):
        return json.dumps(machine.to_document())
    Machine.from_document(machine)
    return json.dumps(machine)
