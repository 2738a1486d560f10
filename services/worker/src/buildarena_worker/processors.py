"""Trials of other kinds of processors, simulated again here."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from buildarena_benchmark import Task
from buildarena_environment.other_kernels import can_run, simulate_with
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Trajectory, processor, simulate

PROCESSOR: Final = "processor"
"""The key of a rollout's versions that says what simulated it, see `buildarena_simulation`."""
KERNELS: Final = ("blas", "numpy", "machine")
"""What must be equal for equal bytes; another libm rarely matters."""


def simulate_as(
    versions: Mapping[str, Any],
    machine: Machine,
    task: Task,
    engine: str,
    *,
    controls: Sequence[KeyPress] | None,
) -> Trajectory:
    """A trial with the kernels that it was simulated with, where this processor has them.

    Args:
        versions: The rollout's; before they named the processor, this process's kernels count.
        machine: The machine.
        task: The task.
        engine: Name of the engine.
        controls: Key presses of this run; None for the machine's own.

    Raises:
        BuildarenaSimulationError: As `buildarena_simulation.simulate`.
    """
    named = versions.get(PROCESSOR)
    kept: Mapping[str, Any] = named if isinstance(named, Mapping) else {}
    own = processor()
    if any(kept.get(name, own[name]) != own[name] for name in KERNELS) and can_run(
        str(kept.get("blas"))
    ):
        return simulate_with(str(kept["blas"]), machine, task.scenario, engine, controls=controls)
    return simulate(machine, task.scenario, engine, controls=controls)


def other_processor(
    versions: Mapping[str, Any], kept: Trajectory | None, repeated: Trajectory
) -> tuple[Any, Mapping[str, Any]] | None:
    """Why a trajectory may differ though nothing is wrong, if another processor made it.

    Args:
        versions: The rollout's.
        kept: The stored trajectory; None where it can't be read.
        repeated: The trajectory that came out now.

    Returns:
        The processor that made the stored one, and this one with how far the two are apart; None
        if they are of one kind.
    """
    then = versions.get(PROCESSOR)
    own = dict(processor())
    if then == own:
        return None
    return then, {**own, **({} if kept is None else _apart(kept, repeated))}


def _apart(kept: Trajectory, repeated: Trajectory) -> dict[str, Any]:
    """From when, and how far, in units, blocks are apart."""
    if kept.positions.shape != repeated.positions.shape:
        return {"apart": "the recordings have other sizes"}
    distance = np.linalg.norm(
        kept.positions.astype(np.float64) - repeated.positions.astype(np.float64), axis=2
    ).max(axis=1, initial=0.0)
    moved = np.flatnonzero(distance > 0.0)
    return {
        "apart_from_s": float(kept.time_s[moved[0]]) if len(moved) else None,
        "farthest_apart": round(float(distance.max(initial=0.0)), 4),
        "breaks": [len(kept.breaks), len(repeated.breaks)],
    }
