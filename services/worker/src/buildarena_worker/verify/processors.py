"""Trials of other kinds of processors, simulated again here with the kernels they had there."""

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
"""The key of a rollout's versions that says what simulated it, see `buildarena_simulation`."""
_LEVELS: Final = {"SkylakeX": "X86_V4", "Haswell": "X86_V3"}
_LOWEST: Final = "X86_V2"


def named_processor(record: RolloutRecord) -> Mapping[str, Any] | None:
    """The processor in a rollout's versions, if they name one; a runner may send anything."""
    named = (record.versions or {}).get(PROCESSOR)
    return named if isinstance(named, Mapping) else None


def kernels_for(record: RolloutRecord) -> list[str]:
    """Return the kernels to repeat a trial with: those it names, if this processor has them.

    Our own workers' results of before they named their kernels are tried with all, this process's
    first. A runner's are not: whoever lies would have every lie simulated with all.
    """
    own, then = processor()["blas"], named_processor(record)
    if then is None:
        others = [name for name in runnable() if name != own]
        return [own, *others] if record.runner is None else [own]
    named = then.get("blas")
    return [named if named in runnable() else own]


def processor_with(name: str) -> Mapping[str, str]:
    """This processor with some kernels, as manifests say it."""
    own = processor()
    return (
        own if name == own["blas"] else {**own, "blas": name, "numpy": _LEVELS.get(name, _LOWEST)}
    )


def simulated(
    name: str,
    record: RolloutRecord,
    machine: Machine,
    task: Task,
    controls: Sequence[KeyPress] | None,
) -> Trajectory:
    """Return a trial again, with some kernels.

    Raises:
        BuildarenaSimulationError: As `buildarena_simulation.simulate`.
    """
    play = task, machine, record.engine
    if name == processor()["blas"]:
        return simulate_task(*play, controls=controls, seed=record.seed)
    return simulate_with(name, *play, controls=controls, seed=record.seed)


def apart(kept: Trajectory, now: Trajectory) -> dict[str, Any]:
    """From when, and how far in units, blocks of two trajectories are apart."""
    if kept.positions.shape != now.positions.shape:
        return {}
    distance = np.linalg.norm(
        kept.positions.astype(np.float64) - now.positions.astype(np.float64), axis=2
    ).max(axis=1, initial=0.0)
    moved = np.flatnonzero(distance > 0.0)
    return {
        "apart_from_s": float(kept.time_s[moved[0]]) if len(moved) else None,
        "farthest_apart": round(float(distance.max(initial=0.0)), 4),
        "breaks": [len(kept.breaks), len(now.breaks)],
    }
