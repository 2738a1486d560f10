"""Machines drawn by a seed: random ones, and designs with random changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import entry_points
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from buildarena_benchmark import Task, broken_constraint, builtin_tasks
from buildarena_cli.dataset.replaying import parts_hash
from buildarena_cli.errors import CommandError
from buildarena_environment import NothingToSubmitError, Workbench
from buildarena_environment.variation.genome import Genome
from buildarena_environment.variation.kinds import kind_of
from buildarena_environment.variation.mutation import START, heaped, mutated
from buildarena_geometry import Machine

Calls = Sequence[Mapping[str, Any]]
Draw = np.random.Generator
GROUP: Final = "buildarena.designs"
"""Entry points of what has designs: a function of task and seed, which gives calls or None."""
DRAWING_VERSION: Final = 1
"""Rises when the same seed draws other machines."""
VARIANTS: Final = 8
"""Seeds that a design is asked for; some give the same machine."""
MAX_DRAWS: Final = 200
"""Draws for one machine; nearly all need one to three."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A machine that was drawn.

    Attributes:
        genome: What builds it.
        parent: The `parts_hash` of the design that it was made from, if there is one.
    """

    genome: Genome
    parent: str | None = None


def heap(task: str, draw: Draw) -> Drawn:
    """Parts on faces of one another, wherever there is room; what is powered gets keys."""
    return Drawn(genome=heaped(kind_of(task), draw))


def grown(task: str, draw: Draw) -> Drawn:
    """Rows, mirrored pairs, connectors and keys, a few at a time, from the starting block on."""
    return Drawn(genome=_changed(Genome(actions=[dict(START)]), task, draw, rounds=(3, 9)))


def design(task: str, draw: Draw) -> Drawn:
    """A design of the built-in expert as it is, in one of its variants."""
    return Drawn(genome=Genome.from_calls(design_calls(task, _variant(draw))))


def edited(task: str, draw: Draw) -> Drawn:
    """Such a design after 1 to 8 random changes: parts, keys and places, taken or given."""
    variant = _variant(draw)
    genome = Genome.from_calls(design_calls(task, variant))
    changed = _changed(genome, task, draw, rounds=(1, 3))
    return Drawn(genome=changed, parent=design_hash(task, variant))


MAKERS: Final[Mapping[str, tuple[Callable[[str, Draw], Drawn], float]]] = MappingProxyType(
    {
        "design": (design, 0.04),
        "edited": (edited, 0.76),
        "grown": (grown, 0.1),
        "heap": (heap, 0.1),
    }
)
"""What makes machines, and how often each is drawn."""
_LONG: Final = frozenset({"mechanisms-1", "mechanisms-3", "mechanisms-7"})
TURNS: Final[Mapping[str, int]] = MappingProxyType({"support": 3, "lift": 3})
"""Machines of a kind of task for each machine of others: their trials are short."""


def _variant(draw: Draw) -> int:
    return int(draw.integers(VARIANTS))


def _changed(genome: Genome, task: str, draw: Draw, *, rounds: tuple[int, int]) -> Genome:
    for _ in range(int(draw.integers(*rounds))):
        genome = mutated(genome, kind_of(task), draw)
    return genome


def design_calls(task: str, seed: int) -> Calls:
    """The calls of a design for a task; none where no distribution has one."""
    return next(filter(None, (calls_of(task, seed) for calls_of in _sources())), [])


@lru_cache(maxsize=4096)
def design_hash(task: str, seed: int) -> str | None:
    """The `parts_hash` of a design's machine; None where there is no design."""
    machine = built(builtin_tasks()[task], design_calls(task, seed))
    return None if machine is None else parts_hash(machine.to_document())


@lru_cache
def _sources() -> Sequence[Callable[[str, int], Calls | None]]:
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return [point.load() for point in points]


def require_designs() -> None:
    """Checks that something has designs.

    Raises:
        CommandError: Nothing that is installed has.
    """
    if not _sources():
        raise CommandError(
            "machines are made from designs, and none are installed: install buildarena-worker"
        )


def drawable_tasks() -> tuple[str, ...]:
    """The tasks that machines are drawn for: all that need no program and tell everything.

    Those whose trials take three times as long as the others' are left out.
    """
    return tuple(
        name
        for name, task in builtin_tasks().items()
        if task.scenario.senses is None
        and task.beginning is None
        and task.unknowns is None
        and name not in _LONG
    )


def cycle_of(tasks: Sequence[str]) -> list[str]:
    """The tasks of machines 0, 1, …, which begin again when it ends; in no order of their own."""
    turns = [name for name in tasks for _ in range(TURNS.get(kind_of(name), 1))]
    order = np.random.default_rng(0).permutation(len(turns))
    return [turns[place] for place in order]


def drawn(task: Task, draw: Draw) -> tuple[str, Drawn, Machine] | None:
    """A machine that keeps the task's constraints, after its maker's name; None of many draws."""
    names, shares = list(MAKERS), [share for _, share in MAKERS.values()]
    for _ in range(MAX_DRAWS):
        maker = str(draw.choice(names, p=shares))
        made = MAKERS[maker][0](task.name, draw)
        machine = built(task, made.genome.as_calls())
        if machine is None or broken_constraint(task, machine) is not None:
            continue
        if made.parent is None or parts_hash(machine.to_document()) != made.parent:
            return maker, made, machine
    return None


def built(task: Task, calls: Calls) -> Machine | None:
    """What calls build; None where one of them is refused, or they leave nothing to submit."""
    bench = Workbench(task.constraints.catalogue, task=task)
    for call in calls:
        if not bench.act(call["machine"], call["tool"], call["arguments"]).ok:
            return None
    try:
        return bench.submitted()
    except NothingToSubmitError:
        return None
