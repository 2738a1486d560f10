"""How a block moves on its seat, and where air and fans push it, in words."""

from __future__ import annotations

from collections.abc import Iterator

from buildarena_geometry.blocks import Block
from buildarena_geometry.feedback.words import caption, rolling
from buildarena_geometry.modules.joints import Drive, MovingJoint
from buildarena_geometry.rotations import Vector, cross, scaled

_ALONG = 0.9999  # cosine; an axis nearer to the block's own than this is that axis


def motions(block: Block) -> list[str]:
    """What a builder must know of where a block's free axis, wing or fan points.

    Wheels with a motor and modules that point say so in words of their own.
    """
    module = block.module
    facts: list[str] = []
    if module.joint is not None and module.physics is not None:
        facts.extend(_joint(block, module.physics.joint_type, module.joint))
    wing, push = module.wing, module.push
    if wing is not None:
        towards = caption(block.world_from_block.direction(wing.normal))
        facts.append(f"open to {towards}" if wing.one_sided else f"flat side faces {towards}")
    if push is not None:
        towards = caption(block.world_from_block.direction(push.direction))
        facts.append(f"{push.action} pushes it {towards}")
    if module.flywheel is not None:
        about = caption(block.world_from_block.direction(module.flywheel.axis))
        facts.append(f"{module.flywheel.left} turns it counterclockwise about {about}")
    return facts


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
    """What a drive does with a block that turns."""
    clockwise = (drive.forward_sense == "clockwise") != block.flipped
    flipped = " (flipped)" if block.flipped else ""
    if rolls:
        return rolling(axis, clockwise=clockwise) + flipped
    away = block.axis_xyz
    if sum(a * b for a, b in zip(axis, away, strict=True)) > _ALONG:
        sense = "clockwise" if clockwise else "counterclockwise"
        does = f"{drive.forward} turns it" if drive.forward else "always turns"
        return f"{does} {sense} seen from outside{flipped}"
    # Counterclockwise about its pin takes the far end this way.
    side = scaled(cross(axis, away), -1.0 if clockwise else 1.0)
    return f"{drive.forward} swings its far end {caption(side)}{flipped}"
