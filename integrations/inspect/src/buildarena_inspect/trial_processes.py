"""Trials in processes of their own, for all samples of this process."""

from __future__ import annotations

import atexit
import os
import threading
from collections import OrderedDict
from functools import cache
from typing import Final

from buildarena_benchmark import Task
from buildarena_environment import Evaluation, Evaluator, Trial
from buildarena_geometry import Machine
from buildarena_simulation import SimulationError

TRIES: Final = 2
"""What ended a process may have been chance; what ends it twice is taken to be the machine."""
Kind = tuple[str, str, str, int | None]
"""Task, its version, simulator, seed: what a warm process is for."""


class TrialProcesses:
    """Tries machines one per core at a time, each in a process that stays warm.

    Called from threads; whoever comes when all are busy waits. A machine that ends its process
    costs its own trial.

    Args:
        count: How many at most; by default one for each core that this process may use.
    """

    def __init__(self, count: int | None = None) -> None:
        self._count = count or len(os.sched_getaffinity(0))
        self._places = threading.BoundedSemaphore(self._count)
        self._lock = threading.Lock()
        self._idle: OrderedDict[Evaluator, Kind] = OrderedDict()

    def __call__(
        self, task: Task, machine: Machine, simulator: str = "mujoco", *, seed: int | None = None
    ) -> Trial:
        """Checks a machine by the task's constraints, and simulates and scores it.

        Raises:
            SimulationError: The engine failed or ended its process, which says nothing of the
                machine.
        """
        found = Evaluation()
        with self._places:
            evaluator = self._taken(task, simulator, seed)
            try:
                for _ in range(TRIES):
                    found = evaluator.evaluate(machine)
                    if found.trial is not None:
                        return found.trial
            finally:
                self._give_back(evaluator)
        raise SimulationError(f"the machine could not be tried: {found.error}")

    def close(self) -> None:
        """Ends the processes."""
        with self._lock:
            idle, self._idle = list(self._idle), OrderedDict()
        for evaluator in idle:
            evaluator.close()

    def _taken(self, task: Task, simulator: str, seed: int | None) -> Evaluator:
        kind = _kind(task, simulator, seed)
        with self._lock:
            fitting = next((free for free, what in self._idle.items() if what == kind), None)
            unwanted = fitting
            if fitting is None and len(self._idle) >= self._count:
                unwanted = next(iter(self._idle))
            if unwanted is not None:
                del self._idle[unwanted]
        if fitting is not None:
            return fitting
        if unwanted is not None:
            unwanted.close()
        return Evaluator(task, simulator, seed=seed, processes=1, trajectories=True)

    def _give_back(self, evaluator: Evaluator) -> None:
        with self._lock:
            self._idle[evaluator] = _kind(evaluator.task, evaluator.simulator, evaluator.seed)


@cache
def trial_processes() -> TrialProcesses:
    """Those of this process; they end with it."""
    made = TrialProcesses()
    atexit.register(made.close)
    return made


def _kind(task: Task, simulator: str, seed: int | None) -> Kind:
    return task.name, task.version, simulator, seed
