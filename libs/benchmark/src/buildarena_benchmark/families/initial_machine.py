"""Initial machines of builders, and the edits to them."""

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Literal

from pydantic import Field

from buildarena_benchmark.families.cars import built, sample_car
from buildarena_benchmark.fields import Document
from buildarena_geometry import Block, Catalogue, Machine


class InitialMachine(Document):
    """Initial machine of a builder: one with faults, sampled by the job's seed.

    Attributes:
        family: Sort of machine; see the module of this name.
        edits: Most edits between it and the finished machine, see `edits_between`.
    """

    family: Literal["cars"]
    faults: Annotated[int, Field(ge=2, le=5)]
    edits: Annotated[int, Field(ge=1, le=100)]


@lru_cache(maxsize=256)
def _machines(initial: InitialMachine, seed: int) -> tuple[Machine, Machine]:
    car = sample_car(seed, initial.faults)
    return built(car), built(car.whole)


def make_initial_machine(
    initial: InitialMachine, seed: int, catalogue: Catalogue | None = None
) -> Machine:
    """Return the machine with its faults; its log is that of a builder who built it so.

    Args:
        catalogue: Modules for building; the basic modules if left out.
    """
    machine = _machines(initial, seed)[0]
    if catalogue is None:
        return machine.copy()
    logged = machine.log
    return Machine.restored(replace(logged, state=replace(logged.state, catalogue=catalogue)))


def make_reference_machine(initial: InitialMachine, seed: int) -> Machine:
    """Return the same machine without its faults."""
    return _machines(initial, seed)[1].copy()


def edits_between(original: Machine, machine: Machine) -> int:
    """Return the number of edits by which a machine differs from the initial one.

    Each block and each connector that is gone or new is one edit; so is each that stayed and is
    is another one, lies otherwise, or turns the other way, and each whose keys are others.
    Undone changes do not count. Ids are never used twice: a part removed and put back counts twice.
    """
    before, after = original.blocks, machine.blocks
    count = len(before.keys() ^ after.keys())
    for name in before.keys() & after.keys():
        was, is_now = before[name], after[name]
        moved = _shape(was) != _shape(is_now) or is_now.mount not in (None, was.mount)
        count += moved + (_keys(was) != _keys(is_now))
    old, new = original.connectors, machine.connectors
    count += len(old.keys() ^ new.keys())
    return count + sum(old[name] != new[name] for name in old.keys() & new.keys())


def has_other_presses(original: Machine, machine: Machine) -> bool:
    """Return whether the key presses are not those of the machine that was given, in any order."""
    return Counter(original.control_sequence) != Counter(machine.control_sequence)


def _shape(block: Block) -> tuple[object, ...]:
    place = (*block.world_from_block.xyz, *block.world_from_block.wxyz)
    return (block.module.name, tuple(round(value, 6) for value in place), block.flipped)


def _keys(block: Block) -> dict[str, frozenset[str]]:
    return {action: frozenset(keys) for action, keys in block.bindings.items() if keys}
