"""What meshes and what is locked, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from buildarena_geometry.feedback.words import listing
from buildarena_geometry.mobility import Mobility, mobility
from buildarena_geometry.state import MachineState


def facts(moving: Mobility, block_id: str) -> Iterator[str]:
    """What a block's line says of its teeth and its joint."""
    if block_id in moving.meshes:
        yield f"meshes with {listing(moving.meshes[block_id])}"
    if block_id in moving.locks:
        yield _locked(moving, block_id)


def consequences(
    before: MachineState, after: MachineState, shown: tuple[str, ...] = ()
) -> Iterator[str]:
    """Sentences on the joints that an action locked or freed and the cogs that it put together.

    Args:
        before: the state before the action.
        after: the state after it.
        shown: ids of blocks whose own lines tell of themselves.
    """
    was, now = mobility(before), mobility(after)
    for block in now.locks:
        if block not in was.locks and block not in shown:
            yield f"{_named(after, block)} is {_locked(now, block)}."
    for block in was.locks:
        if block not in now.locks and block in after.blocks:
            yield f"{_named(after, block)} can move again."
    for cog, others in _new(was.meshes, now.meshes):
        apart = [other for other in others if other not in shown and cog not in shown]
        if apart:
            yield f"{_named(after, cog)} meshes with {listing(apart)}."
    for cog, others in _new(now.meshes, was.meshes):
        if cog in after.blocks:
            yield f"{_named(after, cog)} no longer meshes with {listing(others)}."


def _new(
    before: Mapping[str, tuple[str, ...]], after: Mapping[str, tuple[str, ...]]
) -> Iterator[tuple[str, list[str]]]:
    """What is in the one and not in the other; each pair once."""
    seen: set[frozenset[str]] = set()
    for cog, others in after.items():
        new = [
            other
            for other in others
            if other not in before.get(cog, ()) and frozenset((cog, other)) not in seen
        ]
        seen.update(frozenset((cog, other)) for other in new)
        if new:
            yield cog, new


def _locked(moving: Mobility, block_id: str) -> str:
    holding = moving.locks[block_id]
    return f"locked by {listing(holding)}" if holding else "locked"


def _named(state: MachineState, block_id: str) -> str:
    return f"Block {block_id} ({state.blocks[block_id].module.name})"
