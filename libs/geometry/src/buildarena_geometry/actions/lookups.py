"""Finds what an action's arguments name; refusals name the valid choices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.feedback.state import heading
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.module import Module
from buildarena_geometry.modules.names import CaselessNames
from buildarena_geometry.modules.parameters import RefusalError, shown
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.state import MachineState, SubStructure

_MAX_NAMED = 12  # a refusal names so many choices and counts the rest
_NEAREST = 5  # of more choices, so many that are most like what was written
_LONGEST_NAME = 60  # characters; longer names are compared by their beginning


def require_started(state: MachineState) -> None:
    """Refuses unless there is a starting block.

    Raises:
        RefusalError: nothing has been started.
    """
    if not state.started:
        first = "add_machine" if state.is_assembly else "start"
        raise RefusalError(Cause.NOT_STARTED, f"There is nothing yet; call {first} first.")


def part(state: MachineState, part_id: str) -> Block | Connector:
    """The block or connector with an id.

    Raises:
        RefusalError: there is none.
    """
    require_started(state)
    match = state.blocks.get(part_id) or state.connectors.get(part_id)
    if match is None:
        ids = named([*state.blocks, *state.connectors])
        text = f"There is no block {shown(part_id)}. Blocks: {ids}."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    return match


def powered(state: MachineState, block_id: str, written: str) -> tuple[Block | Connector, str]:
    """The part with an id and the action of it that is meant, if it takes keys.

    Raises:
        RefusalError: no such block, a block without keys, or one without this action.
    """
    target = part(state, block_id)
    actions = target.module.actions
    if not actions:
        keyed = named(other.id for other in state.powered())
        text = f"{heading(target)} takes no keys. Blocks that do: {keyed}."
        raise RefusalError(Cause.NO_LOCOMOTION, text)
    action = CaselessNames(actions).find(written)
    if action is None:
        text = f"{heading(target)} has no action {shown(written)}; its actions: {listing(actions)}."
        raise RefusalError(Cause.BAD_ACTION, text)
    return target, action


def attachable_module(state: MachineState, name: str) -> Module:
    """The module of a name, if it can be attached to a face.

    Raises:
        RefusalError: there is none, or it is a connector.
    """
    module = state.catalogue.named(name)
    if module is not None and module.kind == "connector":
        text = f"A {module.name} joins two faces and can't be attached to one; use connect_blocks."
        raise RefusalError(Cause.CONNECTOR_MISUSE, text)
    if module is None or not module.attachable:
        choices = nearest(name, state.catalogue.attachable)
        text = f"{shown(name)} can't be attached. Modules: {choices}."
        raise RefusalError(Cause.UNKNOWN_MODULE, text)
    return module


def connector_module(state: MachineState, name: str) -> Module:
    """The module of a name, if it is a connector.

    Raises:
        RefusalError: there is none, or it is not a connector.
    """
    module = state.catalogue.named(name)
    if module is None or module.kind != "connector":
        cause = Cause.UNKNOWN_CONNECTOR if module is None else Cause.BASIC_AS_CONNECTOR
        choices = nearest(name, state.catalogue.connectors)
        raise RefusalError(cause, f"{shown(name)} is no connector. Connectors: {choices}.")
    return module


def structure(state: MachineState, letter: str) -> SubStructure:
    """The sub-structure with a letter.

    Raises:
        RefusalError: there is none.
    """
    match = state.structures.get(letter)
    if match is None:
        there = f"Sub-structures: {named(state.structures)}."
        text = f"There is no sub-structure {shown(letter)}. {there}"
        raise RefusalError(Cause.NO_SUCH_MACHINE, text)
    return match


def nearest(written: str, choices: Sequence[str]) -> str:
    """All of some choices, or of many those that are most like what was written."""
    if len(choices) <= _MAX_NAMED:
        return listing(choices)
    folded = {choice.casefold(): choice for choice in choices}
    words = " ".join(written[:_LONGEST_NAME].split()).casefold()
    # "wheel" means one of the wheels, however long their names are.
    within = [choice for fold, choice in folded.items() if words and words in fold]
    alike = get_close_matches(words, folded, n=_NEAREST, cutoff=0.0)
    close = list(dict.fromkeys([*within, *(folded[fold] for fold in alike)]))[:_NEAREST]
    return f"{listing(close)} and {len(choices) - len(close)} more"


def named(choices: Iterable[str]) -> str:
    """The first of some choices, and how many more there are."""
    names = list(choices)
    more = len(names) - _MAX_NAMED
    return listing(names[:_MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
