"""A machine of the dataset as its row: drawn, built, simulated and scored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from buildarena_benchmark import CANARY, Task, builtin_tasks, references
from buildarena_benchmark.flags import is_disqualified
from buildarena_benchmark.outcomes import Outcome
from buildarena_benchmark.tasks.task import SCORER_VERSION
from buildarena_cli.dataset.machines.drawing import Calls, built, drawn
from buildarena_cli.dataset.messages import compact
from buildarena_cli.dataset.replaying import parts_hash
from buildarena_cli.dataset.rows import OURS
from buildarena_environment import Trial, try_machine
from buildarena_environment.rewards import Progress, indicator
from buildarena_environment.variation.kinds import kind_of
from buildarena_geometry import Machine, __version__
from buildarena_simulation import (
    SIMULATION_VERSION,
    SimulationError,
    engine_version,
    processor,
    write_trajectory,
)

Row = dict[str, Any]
ID_LENGTH: Final = 20
RETRIED_SHARE: Final = 0.05
SPLITS: Final = ("train", "validation", "test")
_SPLIT_OF: Final[Mapping[str, str]] = MappingProxyType(
    {"flight": "validation", "throwing": "validation", "lift": "test"}
)
"""Kinds of tasks whose machines, statements and designs no training machine has."""
MADE: Final = ("seed", "number", "maker", "parent")
"""Columns that say where a machine comes from: nothing else in a row follows from them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A machine to draw and try.

    Attributes:
        task: Name of the task.
        simulator: Name of the engine.
        seed: The dataset's.
        number: The machine's place.
        attempt: Which draw for this place: the machine of an earlier one was there already.
    """

    task: str
    simulator: str
    seed: int
    number: int
    attempt: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Repetition:
    """A row to make again.

    Attributes:
        row: What the dataset has.
        calls: Its actions.
        simulate: Whether the trial is repeated; if not, its columns are not in the answer.
    """

    row: Row
    calls: Calls
    simulate: bool = True


def split_of(task: str) -> str:
    """The split of all machines of a task."""
    return _SPLIT_OF.get(kind_of(task), SPLITS[0])


def versions_here(simulator: str) -> Row:
    """The columns that say what tries machines here."""
    return {
        "simulator": simulator,
        "simulator_version": engine_version(simulator),
        "simulation_version": SIMULATION_VERSION,
        "scorer_version": SCORER_VERSION,
        "geometry_version": __version__,
    }


def drawn_row(order: Order) -> Row | None:
    """The row of a machine; None where none was drawn, or the engine failed at it."""
    task = builtin_tasks()[order.task]
    draw = np.random.default_rng([order.seed, order.number, order.attempt])
    drawing = drawn(task, draw)
    if drawing is None:
        return None
    maker, made, machine = drawing
    origin = {
        "seed": order.seed,
        "number": order.number,
        "maker": maker,
        "parent": made.parent,
    }
    try:
        return _row(task, order.simulator, made.genome.as_calls(), machine, origin)
    except SimulationError:
        return None


def repeated_row(repetition: Repetition) -> Row | str:
    """A row made again from its task and its actions, or why there is none."""
    row = repetition.row
    task = builtin_tasks()[row["task"]]
    machine = built(task, repetition.calls)
    if machine is None:
        return "its actions build no machine"
    origin = {name: row[name] for name in MADE}
    if not repetition.simulate:
        return _machine_columns(task, repetition.calls, machine, origin)
    try:
        return _row(task, row["simulator"], repetition.calls, machine, origin)
    except SimulationError as error:
        return str(error)


def working() -> Callable[[Order | Repetition], Row | str | None]:
    """What the processes of a `Crew` do here; what is slow to load is loaded first."""
    builtin_tasks()
    return _worked


def _worked(work: Order | Repetition) -> Row | str | None:
    return drawn_row(work) if isinstance(work, Order) else repeated_row(work)


def _row(task: Task, simulator: str, calls: Calls, machine: Machine, origin: Row) -> Row:
    trial = try_machine(task, machine, simulator, whole=False)
    return {
        **_machine_columns(task, calls, machine, origin),
        **versions_here(simulator),
        "processor": compact(dict(processor())),
        **_trial_columns(task, machine, trial),
    }


def _machine_columns(task: Task, calls: Calls, machine: Machine, origin: Row) -> Row:
    digest = parts_hash(machine.to_document())
    return {
        **origin,
        "id": digest[:ID_LENGTH],
        "task": task.name,
        "task_version": task.version,
        "kind": kind_of(task.name),
        "split": split_of(task.name),
        "actions": compact(list(calls)),
        "blocks": len(machine.blocks),
        "connectors": len(machine.connectors),
        "mass": round(float(machine.mass), 6),
        "parts_sha256": digest,
        "indicator_name": task.indicator.name,
        "indicator_unit": task.indicator.unit,
        "retried": int(digest[:8], 16) < RETRIED_SHARE * 16**8,
        "license": OURS,
        "canary": CANARY,
    }


def _trial_columns(task: Task, machine: Machine, trial: Trial) -> Row:
    progress = Progress(
        task=task,
        reference=references()[task.name],
        machine=machine,
        changes=0,
        refused=0,
        trial=trial,
    )
    succeeded = Outcome.SUCCESS if trial.score.success else Outcome.UNSUCCESSFUL
    return {
        "outcome": succeeded.value,
        "reason": trial.reason,
        "flags": list(trial.score.flags),
        "disqualified": is_disqualified(trial.score.flags),
        "indicator": trial.score.indicator,
        "score": indicator(progress),
        "trajectory_sha256": (
            None
            if trial.trajectory is None
            else sha256(write_trajectory(trial.trajectory)).hexdigest()
        ),
    }
