"""Descriptions of blocks' motion on their faces, of meshing cogs and of locked joints."""

from collections.abc import Iterator, Mapping

from buildarena_geometry.blocks import Block
from buildarena_geometry.feedback.words import caption, listing, rolling
from buildarena_geometry.mobility import Mobility, mobility
from buildarena_geometry.modules.joints import Drive, MovingJoint
from buildarena_geometry.rotations import Vector, cross, dot, scaled
from buildarena_geometry.state import MachineState

_ALONG = 0.9999  # cosine; an axis nearer to the block's own than this is that axis


def motions(block: Block) -> Iterator[str]:
    """Describe the directions of a block's free axis, wing or fan.

    Wheels with a motor and modules that point are described elsewhere.
    """
    module = block.module
    wing, push, flywheel = module.wing, module.push, module.flywheel
    if module.joint is not None and module.physics is not None:
        yield from _joint(block, module.physics.joint_type, module.joint)
    if wing is not None:
        towards = caption(block.world_from_block.direction(wing.normal))
        yield f"open to {towards}" if wing.one_sided else f"flat side faces {towards}"
    if push is not None:
        yield f"{push.action} pushes it {caption(block.world_from_block.direction(push.direction))}"
    if flywheel is not None:
        about = caption(block.world_from_block.direction(flywheel.axis))
        yield f"{flywheel.left} turns it counterclockwise about {about}"


def couplings(moving: Mobility, block_id: str) -> Iterator[str]:
    """Describe the teeth and the joint of a block for its line."""
    if block_id in moving.meshes:
        yield f"meshes with {listing(moving.meshes[block_id])}"
    if block_id in moving.locks:
        yield _locked(moving, block_id)


def consequences(
    before: MachineState, after: MachineState, shown: tuple[str, ...] = ()
) -> Iterator[str]:
    """Describe the joints that an action locked or freed and the cogs that it put together.

    Args:
        shown: ids of blocks whose own lines already describe this.
    """
    was, now = mobility(before), mobility(after)
    for block in now.locks:
        if block not in was.locks and block not in shown:
            yield f"{_name_block(after, block)} is {_locked(now, block)}."
    for block in was.locks:
        if block not in now.locks and block in after.blocks:
            yield f"{_name_block(after, block)} can move again."
    for cog, neighbours in _new(was.meshes, now.meshes):
        unmentioned = [other for other in neighbours if other not in shown and cog not in shown]
        if unmentioned:
            yield f"{_name_block(after, cog)} meshes with {listing(unmentioned)}."
    for cog, neighbours in _new(now.meshes, was.meshes):
        if cog in after.blocks:
            yield f"{_name_block(after, cog)} no longer meshes with {listing(neighbours)}."


def _joint(block: Block, seat: str, joint: MovingJoint) -> Iterator[str]:
    axis = block.world_from_block.direction(joint.axis)
    if seat == "ball":
        yield "turns freely every way"
    elif seat == "constant_velocity":
        yield f"bends freely, shaft {caption(axis)}"
    elif seat == "slider":
        action = None if joint.drive is None else joint.drive.forward
        yield f"{action} moves it {caption(axis)}" if action else f"slides along {caption(axis)}"
    elif joint.drive is None:
        limited = joint.limits is not None
        yield f"swings about {caption(axis)}" if limited else f"turns freely about {caption(axis)}"
    else:
        yield _driven(block, axis, joint.drive, rolls=seat == "axle")


def _driven(block: Block, axis: Vector, drive: Drive, *, rolls: bool) -> str:
    """Describe the effect of a drive on a block that turns."""
    clockwise = (drive.forward_sense == "clockwise") != block.flipped
    flipped = " (flipped)" if block.flipped else ""
    if rolls:
        return rolling(axis, clockwise=clockwise) + flipped
    away = block.axis_xyz
    if dot(axis, away) > _ALONG:
        sense = "clockwise" if clockwise else "counterclockwise"
        does = f"{drive.forward} turns it" if drive.forward else "always turns"
        return f"{does} {sense} seen from outside{flipped}"
    # Counterclockwise about its pin takes the far end this way.
    side = scaled(cross(axis, away), -1.0 if clockwise else 1.0)
    return f"{drive.forward} swings its far end {caption(side)}{flipped}"


def _new(
    before: Mapping[str, tuple[str, ...]], after: Mapping[str, tuple[str, ...]]
) -> Iterator[tuple[str, list[str]]]:
    """Yield the entries of `after` that are not in `before`; each pair once."""
    pairs: set[frozenset[str]] = set()
    for cog, neighbours in after.items():
        new = [
            other
            for other in neighbours
            if other not in before.get(cog, ()) and frozenset((cog, other)) not in pairs
        ]
        pairs.update(frozenset((cog, other)) for other in new)
        if new:
            yield cog, new


def _locked(moving: Mobility, block_id: str) -> str:
    holding = moving.locks[block_id]
    return f"locked by {listing(holding)}" if holding else "locked"


def _name_block(state: MachineState, block_id: str) -> str:
    return f"Block {block_id} ({state.blocks[block_id].module.name})"
