"""Checks of a task's constraints on the machine itself.

Every machine is checked here before a trial: those of models' sessions, of external agents'
submissions, of imported archives that are verified, and of the command `machine simulate`.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Final

from buildarena_benchmark.families.initial_machine import (
    edits_between,
    has_other_presses,
    make_initial_machine,
)
from buildarena_benchmark.tasks.task import Task
from buildarena_geometry import Machine, modules_named
from buildarena_simulation.constants import JointKind
from buildarena_simulation.machine import structure_of
from buildarena_simulation.structure.model import JOINT_KINDS

_MAX_NAMED = 10
_MAX_PRESSES: Final = 2_000
_MAX_PRESS_S: Final = 600.0

Broken = tuple[str, str]
"""A broken constraint: class and sentence."""
Check = Callable[[Task, Machine], Broken | None]


def broken_constraint(task: Task, machine: Machine) -> Broken | None:
    """Return the first constraint of a task that a finished machine breaks.

    Returns:
        Class and sentence, or None when the machine may be simulated.
    """
    checks = (*_checks(task), _violated(_wrong_control))
    return next(filter(None, (check(task, machine) for check in checks)), None)


def share_of_constraints(task: Task, machine: Machine) -> float:
    """Return the share of the checks of `broken_constraint` that a machine passes, 0 to 1."""
    held, checks = 0, _checks(task)
    for check in checks:
        if check(task, machine) is not None:
            break
        held += 1
    return held / len(checks)


def _not_started(_: Task, machine: Machine) -> Broken | None:
    return None if machine.started else ("empty_machine", "no machine was started")


def _only_started(_: Task, machine: Machine) -> Broken | None:
    if len(machine.blocks) == 1 and not machine.connectors:
        return "empty_machine", "the machine is nothing but its starting block"
    return None


def _violated(
    problem: Callable[[Task, Machine], str | None], kind: str = "constraint_violated"
) -> Check:
    """Return a check of a rule, by default one of the task's own."""

    def check(task: Task, machine: Machine) -> Broken | None:
        violation = problem(task, machine)
        return None if violation is None else (kind, violation)

    return check


def _wrong_modules(task: Task, machine: Machine) -> str | None:
    """Return whether the machine has a module that is not allowed, or too few of one."""
    constraints = task.constraints
    used = Counter(block.module.name for block in machine.blocks.values())
    used.update(connector.module.name for connector in machine.connectors.values())
    foreign = set(used) - {*modules_named(constraints.modules), machine.catalogue.start.name}
    if foreign:
        return f"{min(foreign)} is not among the task's modules"
    for name, minimum in constraints.min_modules.items():
        if used[name] < minimum:
            return f"the machine has {used[name]} of {name}, the task asks for {minimum} or more"
    for name, maximum in constraints.max_modules.items():
        if used[name] > maximum:
            return f"the machine has {used[name]} of {name}, the task allows {maximum}"
    return None


def _wrong_presses(_: Task, machine: Machine) -> str | None:
    """Return whether there are too many key presses, or one that ends after any trial."""
    presses = machine.control_sequence
    if len(presses) > _MAX_PRESSES:
        return f"the machine has {len(presses):,} key presses, at most {_MAX_PRESSES:,} are played"
    for number, press in enumerate(presses):
        if not press.time_s + press.hold_for_s <= _MAX_PRESS_S:
            return f"key press {number} ends after {_MAX_PRESS_S:g} s, when every trial is over"
    return None


def _doubled(_: Task, machine: Machine) -> str | None:
    """Return whether two connectors of one module join the same two faces: they carry as one."""
    ids: dict[tuple[object, ...], str] = {}
    for link in machine.connectors.values():
        ends = (link.module.name, frozenset({link.start, link.end}))
        if ends in ids:
            return f"{link.module.name} {link.id} joins the same faces as {ids[ends]}"
        ids[ends] = link.id
    return None


def _wrong_structures(task: Task, machine: Machine) -> str | None:
    """Return whether the machine has too few or too many sub-structures, or an empty one.

    Copies of one sub-structure are enough for the fewest and count once against the most, unless
    the task asks for one.
    """
    used = {block.structure for block in machine.blocks.values()}
    placed = {key: structure for key, structure in machine.state.structures.items() if key in used}
    copies = len(placed) or 1
    minimum, maximum = task.constraints.min_sub_structures, task.constraints.max_sub_structures
    kinds = len({structure.source for structure in placed.values()}) or 1
    count = copies if maximum == 1 or copies < minimum else kinds
    if copies < minimum or count > maximum:
        allowed = str(maximum) if minimum == maximum else f"{minimum} to {maximum}"
        named = "sub-structure" if count == 1 else "sub-structures"
        return f"the machine has {count} {named}, the task asks for {allowed}"
    sizes = Counter(block.structure for block in machine.blocks.values())
    for letter in machine.state.structures:
        if sizes[letter] == 1:
            return f"sub-structure {letter} is nothing but its starting block"
    return None


def _wrong_frame(task: Task, machine: Machine) -> str | None:
    """Return whether the sub-structures without cannons are too small or light, or stuck on.

    A frame is held by connectors alone. Blocks that lie flush on others hold on to them, so that
    connectors would hold nothing.
    """
    rules = task.constraints.frame
    if rules is None:
        return None
    armed = {block.structure for block in machine.blocks.values() if block.module.thrust}
    letters = [letter for letter in machine.state.structures if letter not in armed]
    if not letters:
        return "every sub-structure has cannons: the task asks for a frame without any"
    sizes = Counter(block.structure for block in machine.blocks.values())
    for letter in letters:
        if sizes[letter] < rules.min_blocks:
            return (
                f"the frame {letter} has {sizes[letter]} blocks, the task asks for "
                f"{rules.min_blocks} or more"
            )
    share = _mass_of(machine, letters) / machine.mass
    if share < rules.min_mass_share:
        return (
            f"the frame has {share:.1%} of the machine's mass, with its connectors; the task asks "
            f"for {rules.min_mass_share:.0%} or more"
        )
    stuck = _stuck_together(machine, letters)
    if stuck is not None:
        return (
            f"blocks {stuck[0]} and {stuck[1]} hold on to each other without a connector: leave "
            "room between the frame and the rest, and join them by connectors"
        )
    return None


def edit_limit_violation(task: Task, machine: Machine) -> str | None:
    """Return why a machine differs from the initial one by more than the allowed edits, if so."""
    if task.initial_machine is None:
        return None
    original = make_initial_machine(task.initial_machine, task.seed)
    if has_other_presses(original, machine):
        return "the key presses are given with the machine and stay as they are"
    edits, allowed = edits_between(original, machine), task.initial_machine.edits
    if edits > allowed:
        return f"the machine differs from the given one by {edits} edits, the task allows {allowed}"
    return None


def _mass_of(machine: Machine, letters: Sequence[str]) -> float:
    """Return the mass of sub-structures and of all connectors that end on them, mass units."""
    of = {block.id: block.structure for block in machine.blocks.values()}
    masses = [b.module.mass for b in machine.blocks.values() if b.structure in letters]
    masses += [
        link.mass
        for link in machine.connectors.values()
        if {of[link.start[0]], of[link.end[0]]} & set(letters)
    ]
    return math.fsum(masses)


def _stuck_together(machine: Machine, letters: Sequence[str]) -> tuple[str, str] | None:
    """Return two blocks, in and out of some sub-structures, that more than a connector joins."""
    structure = structure_of(machine)
    of = [machine.blocks[block].structure in letters for block in structure.block_ids]
    members = structure.members
    for first, second, kind in zip(members.first, members.second, members.kind, strict=True):
        if JOINT_KINDS[kind] is not JointKind.BRACE and of[first] != of[second]:
            return structure.block_ids[first], structure.block_ids[second]
    return None


def _unjoined(_: Task, machine: Machine) -> str | None:
    """Return which parts nothing joins to the first starting block, as a sentence.

    Attachments and axles join while they hold, and so do braces and winches.
    """
    loose = machine.detached
    if not loose:
        return None
    letters = [
        letter
        for letter in machine.state.structures
        if all(b.id in loose for b in machine.blocks.values() if b.structure == letter)
    ]
    blocks = [block for block in loose if machine.blocks[block].structure not in letters]
    named = [f"sub-structure {letter}" for letter in letters]
    named += [f"block {block} ({machine.blocks[block].module.name})" for block in blocks]
    shown = named[:_MAX_NAMED]
    if len(named) > len(shown):
        shown.append(f"{len(named) - len(shown)} more")
    listed = shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"
    first = next(iter(machine.blocks))
    verb = "is" if len(named) == 1 else "are"
    return (
        f"{listed} {verb} not joined to the starting block {first}: join every part by an "
        "attachment that holds or a connector"
    )


def _crowded(task: Task, machine: Machine) -> str | None:
    """Return which limit on blocks the machine or one of its sub-structures exceeds, if any."""
    limits = task.constraints
    if len(machine.blocks) > limits.most_blocks:
        return (
            f"the machine has {len(machine.blocks)} blocks, the task allows {limits.most_blocks} "
            "in all"
        )
    sizes = Counter(block.structure for block in machine.blocks.values())
    for letter, size in sizes.items():
        if size > limits.max_blocks:
            named = f"sub-structure {letter}" if letter else "the machine"
            return f"{named} has {size} blocks, the task allows {limits.max_blocks} in one"
    return None


def _wrong_control(task: Task, machine: Machine) -> str | None:
    """Return whether a program acts where the task offers no senses."""
    if machine.controller and not task.takes_programs:
        return "the machine has a controller, and the task offers no senses: it takes keys alone"
    return None


_CHECKS: Final[tuple[Check, ...]] = (
    _not_started,
    _only_started,
    _violated(_crowded),
    _violated(_wrong_modules),
    _violated(_wrong_presses),
    _violated(_doubled),
    _violated(_wrong_structures),
    _violated(_unjoined, "unjoined_parts"),
    _violated(_wrong_frame),
)
"""In this order; each may rely on those before it."""


def _checks(task: Task) -> tuple[Check, ...]:
    """Return the checks of a task: where no machine is given, none can be changed too much."""
    return _CHECKS if task.initial_machine is None else (*_CHECKS, _violated(edit_limit_violation))
