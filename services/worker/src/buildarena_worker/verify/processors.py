"""Repetition of trials from other kinds of processors, with the kernels used there."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_benchmark import Task
from buildarena_benchmark.environment.other_kernels import simulate_with
from buildarena_benchmark.scores import simulate_task
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.kernels import runnable
from buildarena_simulation import Trajectory, processor

PROCESSOR: Final = "processor"
"""Key of a rollout's versions for the simulating processor, see `buildarena_simulation`."""
_LEVELS: Final = {"SkylakeX": "X86_V4", "Haswell": "X86_V3"}
_LOWEST: Final = "X86_V2"


def processor_of(record: RolloutRecord) -> Mapping[str, Any] | None:
    """Return the processor in a rollout's versions, if any; a runner may send anything."""
    named = (record.versions or {}).get(PROCESSOR)
    return named if isinstance(named, Mapping) else None


def kernels_for(record: RolloutRecord) -> list[str]:
    """Return the kernels to repeat a trial with: those it names, if this processor has them.

    A worker's result that names none is repeated with all, this process's first. A runner's is not,
    so that false results do not multiply the cost of verification.
    """
    own, then = processor()["blas"], processor_of(record)
    if then is None:
        alternatives = [name for name in runnable() if name != own]
        return [own, *alternatives] if record.runner is None else [own]
    named = then.get("blas")
    return [named if named in runnable() else own]


def processor_with(name: str) -> Mapping[str, str]:
    """Return this processor with some kernels, in the form of manifests."""
    own = processor()
    return (
        own if name == own["blas"] else {**own, "blas": name, "numpy": _LEVELS.get(name, _LOWEST)}
    )


def simulate(
    name: str,
    record: RolloutRecord,
    machine: Machine,
    task: Task,
    controls: Sequence[KeyPress] | None,
) -> Trajectory:
    """Repeat a trial with some kernels.

    Raises:
        BuildarenaSimulationError: See `buildarena_simulation.simulate`.
    """
    play = task, machine, record.engine
    if name == processor()["blas"]:
        return simulate_task(*play, controls=controls, seed=record.seed)
    return simulate_with(name, *play, controls=controls, seed=record.seed)


def differences(stored: Trajectory, repeated: Trajectory) -> dict[str, Any]:
    """Return the time of the first difference of two trajectories, and the largest, units."""
    if stored.positions.shape != repeated.positions.shape:
        return {}
    distance = np.linalg.norm(
        stored.positions.astype(np.float64) - repeated.positions.astype(np.float64), axis=2
    ).max(axis=1, initial=0.0)
    moved = np.flatnonzero(distance > 0.0)
    return {
        "apart_from_s": float(stored.time_s[moved[0]]) if len(moved) else None,
        "farthest_apart": round(float(distance.max(initial=0.0)), 4),
        "breaks": [len(stored.breaks), len(repeated.breaks)],
    }
