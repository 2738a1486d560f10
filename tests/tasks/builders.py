"""Machines of verdicts that a few figures describe; each function is named in a `verdicts.json`."""

from collections.abc import Sequence
from dataclasses import replace

from support.machines.building import KeyedDraft
from support.machines.headroom import Presses, drafted
from support.machines.piloted import experts_machine
from support.machines.repairs import TRICKS, repaired

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, UP, WEST, Draft
from buildarena_geometry import Machine


def payload(presses: Presses) -> Machine:
    """The expert's rocket, whose gripper lets go at a key."""
    design = expert_designs()["lift-4"](0)
    assert design.control is not None
    gripper = design.control["control_config"][0]
    released = {**gripper, "action": "release", "keys": ["Alpha3"]}
    config = [*design.control["control_config"], released]
    return drafted(replace(design, control={"control_config": config}), presses)


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


def with_boulder(face_of: str) -> Machine:
    """The expert's catapult with a second boulder."""
    machine = drafted(expert_designs()["throw-1"](0), modules="all")
    for face in "ABCDEF":
        told = {"base_block": face_of, "face": face, "new_block": "Boulder"}
        if machine.act("attach_block_to", told).ok:
            return machine
    raise ValueError(f"block {face_of} has no free face")


def repair(trick: str = "", seed: int = 0) -> Machine:
    """The car of a seed, repaired or with a trick of `repairs.TRICKS`."""
    task = builtin_tasks()["repair-1"].with_seed(seed)
    return TRICKS[trick](task) if trick else repaired(task)


def straddler(half: int, presses: Presses, foot: str = "") -> Machine:
    """A gantry whose wheels, or feet with driven wheels between them, are beside a track.

    Args:
        half: Blocks from its middle to a leg.
        presses: Time, key and duration of each, seconds.
        foot: Module at the ends of the legs in place of driven wheels.
    """
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    ends = [middle, draft.row(middle, NORTH, 3)[-1]]
    wheels = []
    for base in ends:
        for way in (EAST, WEST):
            leg = draft.row(draft.row(base, way, half)[-1], DOWN, 2)[-1]
            if foot:
                draft.attach(leg, way, foot)
            else:
                wheels.append(draft.wheel(leg, way))
        if foot:
            post = draft.row(base, DOWN, 2)[-1]
            wheels += [draft.wheel(post, way) for way in (EAST, WEST)]
    for wheel in wheels:
        draft.bind(wheel, "spinning_forward", "UpArrow")
    for time, key, hold_for in presses:
        draft.press(key, time, hold_for)
    return draft.machine
