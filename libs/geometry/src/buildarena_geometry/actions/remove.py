"""Actions that take parts of a machine away, or all of it."""

from dataclasses import replace

from buildarena_geometry.actions.lookups import part
from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.changes import Change
from buildarena_geometry.feedback import state as words
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.parameters import BlockId, RefusalError
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.state import MachineState


def remove_block(state: MachineState, block_id: BlockId) -> Change:
    """Remove a block or connector; blocks on it stay.

    Args:
        block_id: Id of the block or connector.
    """
    gone = part(state, block_id)
    if isinstance(gone, Connector):
        connectors = {key: link for key, link in state.connectors.items() if key != gone.id}
        after = replace(state, connectors=connectors)
        return _removal(state, after, gone, ())
    if gone.module.kind == "start":
        text = f"{words.heading(gone)} can't be removed; reset starts anew."
        raise RefusalError(Cause.START_BLOCK, text)
    after, links = without(state, [gone])
    return _removal(state, after, gone, links)


def reset(state: MachineState) -> Change:
    """Remove everything."""
    after = MachineState(catalogue=state.catalogue, available=state.available)
    return Change(
        after=after,
        removed=(*state.blocks, *state.connectors),
        render=lambda: "Everything is removed; ids start at 1 again.",
    )


def without(state: MachineState, gone: list[Block]) -> tuple[MachineState, tuple[str, ...]]:
    """Return the state without some blocks and the connectors that end on them.

    Returns:
        The state, in which the faces they used are open and blocks that sat on them sit on nothing,
        and the ids of the connectors that went too.
    """
    ids = {block.id for block in gone}
    blocks = {key: block for key, block in state.blocks.items() if key not in ids}
    occupants = dict(state.occupants)
    for block in gone:
        if block.mount is not None:
            occupants.pop(block.mount, None)
        for child in state.children(block):
            if child.id in blocks:
                blocks[child.id] = replace(child, mount=None, lost_mount=child.mount)
        for face in block.module.faces:
            occupants.pop((block.id, face.label), None)
    links = tuple(link.id for link in state.connectors.values() if not ids.isdisjoint(link.ends))
    connectors = {key: link for key, link in state.connectors.items() if key not in links}
    return replace(state, blocks=blocks, occupants=occupants, connectors=connectors), links


def removal_sentences(
    before: MachineState, after: MachineState, links: tuple[str, ...]
) -> list[str]:
    """Describe the parts that a removal took along, left unattached, and cooled."""
    went = [f"Connectors that ended on it went too: {listing(links)}."] if links else []
    return [*went, *words.detached(after), *words.cooled(before, after)]


def _removal(
    before: MachineState, after: MachineState, gone: Block | Connector, links: tuple[str, ...]
) -> Change:
    def render() -> str:
        return " ".join([f"Removed {words.title(gone)}.", *removal_sentences(before, after, links)])

    return Change(after=after, removed=(gone.id, *links), render=render)
