"""Poses in Besiege's components: for its machine files, and for the golden vectors.

Besiege (Unity) is left-handed: x east, y up, z north. A point maps by swapping its last two
components. A block's frame there has +z away from the face it sits on, as ours; for handedness ours
has its x axis the other way round. The starting block's frame has the world's axes in both.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from buildarena_geometry.rotations import Quaternion, Vector, multiply, positive

if TYPE_CHECKING:
    from buildarena_geometry.blocks import Block, Connector

# Our block axes in swapped components: x mirrored and the last two swapped is this half turn.
_BLOCK_FROM_SWAPPED: Quaternion = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


def besiege_point(world: Vector) -> Vector:
    """A point or offset of the world frame in Besiege's components."""
    x, y, z = world
    return (x, z, y)


def besiege_rotation(part: Block | Connector) -> Quaternion:
    """A part's orientation in Besiege's components, a unit quaternion (w, x, y, z)."""
    if hasattr(part, "world_from_connector"):
        wxyz = multiply(part.world_from_connector.wxyz, _BLOCK_FROM_SWAPPED)
    elif part.module.kind == "start":
        wxyz = part.world_from_block.wxyz
    else:
        wxyz = multiply(part.world_from_block.wxyz, _BLOCK_FROM_SWAPPED)
    w, x, y, z = wxyz
    # Swapping two axes mirrors the world, which turns every rotation's sense round.
    return positive((w, -x, -z, -y))


def besiege_span(link: Connector) -> Vector:
    """From a connector's start to its end in its own frame, in Besiege's components."""
    x, y, z = link.span
    return (-x, y, z)
