"""Trials of other kinds of processors, simulated again here."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_benchmark import Task
from buildarena_benchmark.environment.other_kernels import simulate_with
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.kernels import runnable
from buildarena_simulation import Trajectory, processor, simulate

PROCESSOR: Final = "processor"
"""The key of a rollout's versions that says what simulated it, see `buildarena_simulation`."""
_LEVELS: Final = {"SkylakeX": "X86_V4", "Haswell": "X86_V3"}
_LOWEST: Final = "X86_V2"


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeated:
    """A trial that was simulated again.

    Attributes:
        trajectory: What came of it.
        processor: What simulated it here, as manifests say it.
    """

    trajectory: Trajectory
    processor: Mapping[str, str]


def repetitions(
    record: RolloutRecord,
    machine: Machine,
    task: Task,
    *,
    controls: Sequence[KeyPress] | None,
) -> Iterator[Repeated]:
    """A trial with the kernels that it was simulated with, where this processor has them.

    Our own workers' results of before they named their kernels are tried with all, this process's
    first. A runner's are not: whoever lies would have every lie simulated with all.

    Args:
        record: The rollout.
        machine: The machine.
        task: The task.
        controls: Key presses of this run; None for the machine's own.

    Raises:
        BuildarenaSimulationError: As `buildarena_simulation.simulate`.
    """
    own, engine = processor(), record.engine
    others = [name for name in runnable() if name != own["blas"]]
    then = named_processor(record.versions or {})
    tried = others if then is None and record.runner is None else []
    if (first := repeating_processor(record)["blas"]) != own["blas"]:
        tried = [first]
    else:
        trajectory = simulate(
            machine,
            task.scenario,
            engine,
            controls=None if controls is None else tuple(controls),
            seed=record.seed,
        )
        yield Repeated(trajectory=trajectory, processor=own)
    for name in tried:
        trajectory = simulate_with(
            name, machine, task.scenario, engine, controls=controls, seed=record.seed
        )
        yield Repeated(trajectory=trajectory, processor=_with(name))


def repeating_processor(record: RolloutRecord) -> Mapping[str, str]:
    """What simulates a trial first when it is repeated: its own kernels, or this process's."""
    own, then = processor(), named_processor(record.versions or {})
    name = own["blas"] if then is None else then.get("blas")
    return own if name == own["blas"] or name not in runnable() else _with(str(name))


def _with(name: str) -> dict[str, str]:
    """This processor with other kernels, as manifests say it."""
    numpy = _LEVELS.get(name, _LOWEST)
    return {**processor(), "blas": name, "numpy": numpy}


def named_processor(versions: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The processor in a rollout's versions, if they name one; a runner may send anything."""
    named = versions.get(PROCESSOR)
    return named if isinstance(named, Mapping) else None


def other_processors(
    record: RolloutRecord, kept: Trajectory | None, repeated: Repeated | None
) -> list[tuple[Mapping[str, Any] | None, Mapping[str, Any]]]:
    """The processor that simulated a trial, and what is said of the one here, if it is another.

    Args:
        record: The rollout.
        kept: As for `difference`.
        repeated: What came out now; None where the machine's program failed.
    """
    then = named_processor(record.versions or {})
    here = repeating_processor(record) if repeated is None else repeated.processor
    # A runner that names no processor gains nothing by it.
    if then == here or (then is None and record.runner is not None):
        return []
    told = here if repeated is None else difference(kept, repeated)
    return [(then and dict(then), dict(told))]


def difference(kept: Trajectory | None, repeated: Repeated) -> dict[str, Any]:
    """The processor here, and from when, and how far in units, blocks are apart.

    Args:
        kept: The stored trajectory; None where it can't be read.
        repeated: What came out now.
    """
    told: dict[str, Any] = dict(repeated.processor)
    now = repeated.trajectory
    if kept is None or kept.positions.shape != now.positions.shape:
        return told
    distance = np.linalg.norm(
        kept.positions.astype(np.float64) - now.positions.astype(np.float64), axis=2
    ).max(axis=1, initial=0.0)
    moved = np.flatnonzero(distance > 0.0)
    return {
        **told,
        "apart_from_s": float(kept.time_s[moved[0]]) if len(moved) else None,
        "farthest_apart": round(float(distance.max(initial=0.0)), 4),
        "breaks": [len(kept.breaks), len(now.breaks)],
    }
