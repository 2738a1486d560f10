"""What an action proposes: the next state, and what must be checked and reported."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from buildarena_geometry.blocks import Block
from buildarena_geometry.outcomes import AttemptedBlock
from buildarena_geometry.state import MachineState


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A valid action's effect, apart from overlaps, which are checked before it is taken over.

    Attributes:
        after: the next state.
        render: puts the feedback into words.
        placed: ids of blocks that are new or have moved: as one rigid body, not against each other.
        removed: ids of blocks and connectors that are gone.
        touched: ids of other parts that changed without moving.
        attempt: what the action tried, as a refusal for overlap begins.
    """

    after: MachineState
    render: Callable[[], str]
    placed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    touched: tuple[str, ...] = ()
    attempt: str = ""


def attempted(blocks: Iterable[Block]) -> tuple[AttemptedBlock, ...]:
    """Blocks as a refusal names them: where they would have been."""
    return tuple(
        AttemptedBlock(
            id=block.id,
            module=block.module.name,
            position=block.world_from_block.xyz,
            quaternion=block.world_from_block.wxyz,
        )
        for block in blocks
    )
