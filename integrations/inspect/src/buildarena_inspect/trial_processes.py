"""Trials in separate processes, which all samples of this process share."""

from __future__ import annotations

import atexit
from functools import cache
from typing import Final

from buildarena_benchmark import Task
from buildarena_benchmark.environment import Trial, TrialPool
from buildarena_geometry import Machine
from buildarena_simulation import DEFAULT_ENGINE, SimulationError

ATTEMPTS: Final = 2
"""A process may end by chance once; if it ends twice, the machine is considered the cause."""


def try_machine(
    task: Task, machine: Machine, simulator: str = DEFAULT_ENGINE, *, seed: int | None = None
) -> Trial:
    """Simulate a machine like the environment's `try_machine`, in a running process.

    Raises:
        SimulationError: The engine failed or ended its process.
    """
    for left in reversed(range(ATTEMPTS)):
        try:
            return _pool().try_machine(task, machine, simulator, seed=seed)
        except SimulationError as error:
            if not left:
                raise SimulationError(f"the machine could not be simulated: {error}") from error
    raise AssertionError("the last attempt returns or raises")


@cache
def _pool() -> TrialPool:
    """Return the pool of this process, which ends with it."""
    pool = TrialPool(trajectories=True)
    atexit.register(pool.close)
    return pool
