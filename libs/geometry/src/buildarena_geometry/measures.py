"""Where a machine's mass and its outline lie."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.blocks import Block
from buildarena_geometry.modules.solids import Ball, Box, Solid
from buildarena_geometry.state import MachineState


def center_of_mass(state: MachineState) -> NDArray[np.float64]:
    """The center of mass; blocks count at their centers, connectors at their middles.

    Returns:
        (3,) world frame, units.

    Raises:
        ValueError: the machine is empty.
    """
    if not state.started:
        raise ValueError("an empty machine has no center of mass")
    points = [block.center for block in state.blocks.values()]
    points += [(link.start_point + link.end_point) / 2 for link in state.connectors.values()]
    masses = [part.module.mass for part in state.parts]
    center: NDArray[np.float64] = np.average(np.array(points), axis=0, weights=masses)
    return center


def bounds(state: MachineState) -> NDArray[np.float64]:
    """The smallest box along the world's axes around the blocks' bodies.

    Returns:
        (2, 3) smallest and largest coordinates, world frame, units.

    Raises:
        ValueError: the machine is empty.
    """
    if not state.started:
        raise ValueError("an empty machine has no bounds")
    extents = np.array(
        [_extent(block, solid) for block in state.blocks.values() for solid in block.module.body]
    )
    return np.array([extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)])


def _extent(block: Block, solid: Solid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smallest and largest coordinates of one solid, world frame."""
    rotation = block.world_from_block.rotation
    if isinstance(solid, Box):
        middle = block.world_from_block.apply(solid.center)
        reach = np.abs(rotation) @ (np.array(solid.size) / 2)
        return middle - reach, middle + reach
    if isinstance(solid, Ball):
        middle = block.world_from_block.apply(solid.center)
        return middle - solid.radius, middle + solid.radius
    ends = block.world_from_block.apply([solid.base, solid.top])
    axis = (ends[1] - ends[0]) / solid.length
    reach = solid.radius * np.sqrt(np.clip(1 - axis**2, 0, None))
    return ends.min(axis=0) - reach, ends.max(axis=0) + reach
