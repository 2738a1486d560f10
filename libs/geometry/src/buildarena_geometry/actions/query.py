"""Questions about the machine; they change nothing."""

from buildarena_geometry.actions.lookups import part
from buildarena_geometry.actions.parameters import BlockId
from buildarena_geometry.blocks import Block
from buildarena_geometry.feedback import state as words
from buildarena_geometry.state import Change, MachineState


def get_machine_summary(state: MachineState) -> Change:
    """List mass, inertia, size and all parts with base/face, position [east, north, up] and use."""
    return Change(after=state, render=lambda: words.summary(state))


def get_block_details(state: MachineState, block_id: BlockId) -> Change:
    """Show a block's position, faces, the blocks on them, and keys.

    Args:
        block_id: Id of the block or connector.
    """
    target = part(state, block_id)
    if isinstance(target, Block):
        return Change(after=state, render=lambda: words.block_details(state, target))
    return Change(after=state, render=lambda: f"{words.connector_line(target)}.")


def review_powered_blocks(state: MachineState) -> Change:
    """List the blocks that take keys and what they do."""
    return Change(after=state, render=lambda: words.powered_blocks(state))


def review_control_config(state: MachineState) -> Change:
    """List the key bindings."""
    return Change(after=state, render=lambda: words.control_config(state))


def review_control_sequence(state: MachineState) -> Change:
    """List the key presses."""
    return Change(after=state, render=lambda: words.control_sequence(state))
