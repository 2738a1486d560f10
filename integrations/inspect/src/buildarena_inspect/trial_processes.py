"""Trials in processes of their own, shared by all samples of this process."""

from __future__ import annotations

import atexit
from functools import cache
from typing import Final

from buildarena_benchmark import Task
from buildarena_benchmark.environment import Trial, TrialPool
from buildarena_geometry import Machine
from buildarena_simulation import DEFAULT_ENGINE, SimulationError

TRIES: Final = 2
"""What ended a process may have been chance; what ends it twice is taken to be the machine."""


def try_machine(
    task: Task, machine: Machine, simulator: str = DEFAULT_ENGINE, *, seed: int | None = None
) -> Trial:
    """As the environment's `try_machine`, in a warm process; waits where all are busy.

    Raises:
        SimulationError: The engine failed or ended its process, which says nothing of the machine.
    """
    for left in reversed(range(TRIES)):
        try:
            return _pool().try_machine(task, machine, simulator, seed=seed)
        except SimulationError as error:
            if not left:
                raise SimulationError(f"the machine could not be tried: {error}") from error
    raise AssertionError("there is a last try")


@cache
def _pool() -> TrialPool:
    """That of this process; it ends with it."""
    pool = TrialPool(trajectories=True)
    atexit.register(pool.close)
    return pool
