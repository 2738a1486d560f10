"""Poses in Besiege's components and back: for its machine files, its logs, and the golden vectors.

Besiege (Unity) is left-handed: x east, y up, z north. A point maps by swapping its last two
components. A block's frame there has +z away from the face it sits on, as ours; for handedness ours
has its x axis the other way round. The starting block's frame has the world's axes in both.
"""

import math

from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.modules.module import Module
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Quaternion, Vector, multiply, positive

# Our block axes in swapped components: x mirrored and the last two swapped is this half turn.
_BLOCK_FROM_SWAPPED: Quaternion = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
_SWAPPED_FROM_BLOCK: Quaternion = (0.0, 0.0, -math.sqrt(0.5), -math.sqrt(0.5))


def besiege_point(world: Vector) -> Vector:
    """Convert a point or offset of the world frame to Besiege's components."""
    x, y, z = world
    return (x, z, y)


def besiege_turn(world: Quaternion) -> Quaternion:
    """Convert a world rotation, (w, x, y, z), to Besiege's components; its own inverse."""
    w, x, y, z = world
    # Swapping two axes mirrors the world, which reverses every rotation.
    return positive((w, -x, -z, -y))


def besiege_rotation(part: Block | Connector) -> Quaternion:
    """Return a part's orientation in Besiege's components, a unit quaternion (w, x, y, z)."""
    if hasattr(part, "world_from_connector"):
        return besiege_frame(part.world_from_connector.wxyz)
    if part.module.kind == "start":
        return besiege_turn(part.world_from_block.wxyz)
    return besiege_frame(part.world_from_block.wxyz)


def besiege_frame(world_from_face: Quaternion) -> Quaternion:
    """Convert the orientation of a face's frame, or of a block on it, to Besiege's components."""
    return besiege_turn(multiply(world_from_face, _BLOCK_FROM_SWAPPED))


def pose_from_besiege(module: Module, position: Vector, rotation: Quaternion) -> Pose:
    """Return the pose world_from_block (or world_from_connector) of a part in Besiege's components.

    Args:
        position: in Besiege's components, units.
        rotation: in Besiege's components, (w, x, y, z), of any length but zero.

    Raises:
        ValueError: a number that is not finite, or a rotation without a length.
    """
    turn = besiege_turn(rotation)
    wxyz = turn if module.kind == "start" else multiply(turn, _SWAPPED_FROM_BLOCK)
    return Pose(position=besiege_point(position), quaternion=wxyz)


def besiege_offset(within: Vector) -> Vector:
    """Convert an offset in a face's frame to Besiege's components; its own inverse."""
    x, y, z = within
    return (-x, y, z)
