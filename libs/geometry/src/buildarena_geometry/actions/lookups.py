"""Finds what an action's arguments name; refusals name the valid choices."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

from buildarena_geometry.actions.parameters import RefusalError, quote
from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.feedback.state import heading
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.module import Module
from buildarena_geometry.modules.names import CaselessNames
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.state import MachineState, SubStructure

_MAX_NAMED = 12  # choices that a refusal names; it counts the others
_NEAREST = 5  # choices most like the query that a refusal names if there are more
_LONGEST_NAME = 60  # characters; longer names are compared by their beginning


def require_started(state: MachineState) -> None:
    """Refuse unless there is a starting block.

    Raises:
        RefusalError: nothing has been started.
    """
    if not state.started:
        first = "add_machine" if state.available else "start"
        raise RefusalError(Cause.NOT_STARTED, f"There is nothing yet; call {first} first.")


def part(state: MachineState, part_id: str) -> Block | Connector:
    """Return the block or connector with an id.

    Raises:
        RefusalError: no part has this id.
    """
    require_started(state)
    match = state.blocks.get(part_id) or state.connectors.get(part_id)
    if match is None:
        ids = join_names([*state.blocks, *state.connectors])
        text = f"There is no block {quote(part_id)}. Blocks: {ids}."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    return match


def powered(state: MachineState, block_id: str, written: str) -> tuple[Block | Connector, str]:
    """Return the part with an id and the action of it that is meant, if it takes keys.

    Raises:
        RefusalError: no such block, a block without keys, or one without this action.
    """
    target = part(state, block_id)
    actions = target.module.actions
    if not actions:
        keyed = join_names(other.id for other in state.powered())
        text = f"{heading(target)} takes no keys. Blocks that do: {keyed}."
        raise RefusalError(Cause.NO_LOCOMOTION, text)
    action = CaselessNames(actions).find(written)
    if action is None:
        text = f"{heading(target)} has no action {quote(written)}; its actions: {listing(actions)}."
        raise RefusalError(Cause.BAD_ACTION, text)
    return target, action


def attachable_module(state: MachineState, name: str) -> Module:
    """Return the module of a name, if it can be attached to a face.

    Raises:
        RefusalError: the name is unknown or a connector's.
    """
    module = state.catalogue.named(name)
    if module is not None and module.kind == "connector":
        text = f"A {module.name} joins two faces and can't be attached to one; use connect_blocks."
        raise RefusalError(Cause.CONNECTOR_MISUSE, text)
    if module is None or not module.attachable:
        choices = nearest(name, state.catalogue.attachable)
        text = f"{quote(name)} can't be attached. Modules: {choices}."
        raise RefusalError(Cause.UNKNOWN_MODULE, text)
    return module


def connector_module(state: MachineState, name: str) -> Module:
    """Return the module of a name, if it is a connector.

    Raises:
        RefusalError: the name is unknown or not a connector's.
    """
    module = state.catalogue.named(name)
    if module is None or module.kind != "connector":
        cause = Cause.UNKNOWN_CONNECTOR if module is None else Cause.BASIC_AS_CONNECTOR
        choices = nearest(name, state.catalogue.connectors)
        raise RefusalError(cause, f"{quote(name)} is no connector. Connectors: {choices}.")
    return module


def structure(state: MachineState, letter: str) -> SubStructure:
    """Return the sub-structure with a letter.

    Raises:
        RefusalError: no sub-structure has this letter.
    """
    match = state.structures.get(letter)
    if match is None:
        choices = f"Sub-structures: {join_names(state.structures)}."
        text = f"There is no sub-structure {quote(letter)}. {choices}"
        raise RefusalError(Cause.NO_SUCH_MACHINE, text)
    return match


def nearest(written: str, choices: Sequence[str]) -> str:
    """Return all choices, or, if there are many, those that are most like `written`."""
    if len(choices) <= _MAX_NAMED:
        return listing(choices)
    folded = {choice.casefold(): choice for choice in choices}
    query = " ".join(written[:_LONGEST_NAME].split()).casefold()
    # "wheel" means one of the wheels, however long their names are.
    within = [choice for fold, choice in folded.items() if query and query in fold]
    alike = get_close_matches(query, folded, n=_NEAREST, cutoff=0.0)
    close = list(dict.fromkeys([*within, *(folded[fold] for fold in alike)]))[:_NEAREST]
    return f"{listing(close)} and {len(choices) - len(close)} more"


def join_names(choices: Iterable[str]) -> str:
    """Join the first of some choices, followed by the number of those left out."""
    names = list(choices)
    more = len(names) - _MAX_NAMED
    return listing(names[:_MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
