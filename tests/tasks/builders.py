"""Machines of verdicts that a few figures describe; each function is named in a `verdicts.json`."""

from collections.abc import Sequence
from typing import Any, Final

from support.machines.building import KeyedDraft
from support.machines.headroom import Presses, drafted
from support.machines.piloted import experts_machine
from support.machines.repairs import TRICKS, repaired

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Draft
from buildarena_geometry import Machine

WAYS: Final = {"north": NORTH, "south": SOUTH, "east": EAST, "west": WEST, "up": UP, "down": DOWN}


def sketched(
    steps: Sequence[Sequence[Any]],
    expert: str = "",
    presses: Presses | None = None,
    program: str = "",
) -> Machine:
    """A machine of steps, on top of what the expert builds for a task if one is named.

    Args:
        steps: Each the name of a method of `KeyedDraft` with its arguments, directions by name.
        presses: Of the expert's machine, in place of its own: time, key and duration, seconds.
    """
    draft = KeyedDraft(modules="all")
    if expert:
        draft.machine = drafted(expert_designs()[expert](0), presses, modules="all")
    for method, *given in steps:
        getattr(draft, method)(*(WAYS.get(str(each), each) for each in given))
    return draft.machine.with_controller(program) if program else draft.machine


def islands(along: int, across: int, connector: str) -> Machine:
    """A short deck in a gap of 10, held by four connectors from two bars on the terrains.

    Args:
        along: Blocks of the deck from south to north.
        across: From west to east.
        connector: Name of the module that holds it.
    """
    deck, bar = Draft(modules="all"), Draft(modules="all")
    row = [deck.start()]
    row += deck.row(row[0], NORTH, along - 1)
    for block in row:
        deck.row(block, EAST, across - 1)
    bar.row(bar.start(), EAST, 1)
    whole = Draft({"deck": deck.machine, "bar": bar.machine}, modules="all")
    for name, shift in (("deck", 0), ("bar", 7 + along // 2), ("bar", -7 - (along - 1) // 2)):
        told = {"init_shift": [0, shift, 0], "init_rotation": [0, 0, 0]}
        whole.do("add_machine", machine_id=name, **told)
    for end, near in (("B", row[-1]), ("C", row[0])):
        for way in (UP, DOWN):
            whole.connect(f"{end}_1", f"A_{near}", way, connector=connector)
    return whole.machine


def reprogrammed(task: str, program: str = "", edits: Sequence[tuple[str, str]] = ()) -> Machine:
    """The expert's machine with another program, or with its own, edited."""
    machine = experts_machine(builtin_tasks()[task])
    program = program or str(machine.controller)
    for before, after in edits:
        assert program.count(before) == 1, before
        program = program.replace(before, after)
    return machine.with_controller(program)


def repair(trick: str = "", seed: int = 0) -> Machine:
    """The car of a seed, repaired or with a trick of `repairs.TRICKS`."""
    task = builtin_tasks()["repair-1"].with_seed(seed)
    return TRICKS[trick](task) if trick else repaired(task)
