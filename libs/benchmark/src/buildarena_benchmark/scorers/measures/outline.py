"""Where a machine's bodies reach to, as it moves."""

from typing import TYPE_CHECKING

import numpy as np

from buildarena_benchmark.scorers.measures.components import Mask
from buildarena_benchmark.scorers.measures.series import Series, rotations
from buildarena_geometry.modules.solids import Ball, Cylinder

if TYPE_CHECKING:
    from buildarena_geometry import Block, Machine
    from buildarena_geometry.modules.solids import Solid
    from buildarena_simulation import Trajectory


def lowest_points(machine: "Machine", trajectory: "Trajectory", members: Mask) -> Series:
    """Height of the lowest point of some of the tracked blocks, (T,), units; infinite of none.

    Args:
        machine: Gives the blocks' bodies.
        trajectory: The trial.
        members: (T, N) which of the tracked blocks.
    """
    low = np.full(members.shape, np.inf)
    for column, name in enumerate(trajectory.block_ids):
        block = machine.blocks[name]
        turns = rotations(trajectory.quaternions[:, column])
        height = trajectory.positions[:, column, 2].astype(np.float64)
        for solid in block.module.body:
            low[:, column] = np.minimum(low[:, column], height + _lowest(block, solid, turns))
    return np.asarray(np.where(members, low, np.inf).min(axis=1, initial=np.inf))


def _lowest(block: "Block", solid: "Solid", turns: Series) -> Series:
    """Height of a solid's lowest point above its block's shown position, (T,), units."""
    shown = np.array(block.module.center)
    up = turns[:, 2]
    if isinstance(solid, Cylinder):
        pose = solid.block_from_axis
        along = up @ np.array(pose.rotation)[:, 2]
        across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
        reach = solid.length / 2 * np.abs(along) + solid.radius * across
        return np.asarray(up @ (np.array(pose.position) - shown) - reach)
    if isinstance(solid, Ball):
        return np.asarray(up @ (np.array(solid.center) - shown) - solid.radius)
    reach = np.abs(up) @ (np.array(solid.size) / 2)
    return np.asarray(up @ (np.array(solid.center) - shown) - reach)
