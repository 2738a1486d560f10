"""Effect that an action proposes: the next state, and the parts to check and report."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from buildarena_geometry.blocks import Block
from buildarena_geometry.outcomes import AttemptedBlock
from buildarena_geometry.state import MachineState


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A valid action's effect; overlaps are checked before it is applied.

    Attributes:
        render: function that words the feedback.
        placed: ids of new or moved blocks; they form one rigid body and are not tested against each
            other.
        removed: ids of removed blocks and connectors.
        touched: ids of other parts that changed without moving.
        attempt: beginning of the refusal text in case of an overlap.
    """

    after: MachineState
    render: Callable[[], str]
    placed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    touched: tuple[str, ...] = ()
    attempt: str = ""


def attempted(blocks: Iterable[Block]) -> tuple[AttemptedBlock, ...]:
    """Return the blocks as a refusal names them: at the poses that were refused."""
    return tuple(
        AttemptedBlock(
            id=block.id,
            module=block.module.name,
            position=block.world_from_block.xyz,
            quaternion=block.world_from_block.wxyz,
        )
        for block in blocks
    )
