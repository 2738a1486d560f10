"""Extents of a machine's bodies as it moves."""

import numpy as np

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, rotations
from buildarena_geometry import Block
from buildarena_geometry.modules.solids import Ball, Cylinder, Solid


def lowest_points(run: Run, members: Mask) -> Series:
    """Return the lowest height of some of the tracked blocks, (T,), units; infinite of none.

    Args:
        members: (T, N) bool, of the tracked blocks.
    """
    low, _ = extents(run, axis=2)
    return np.asarray(np.where(members, low, np.inf).min(axis=1, initial=np.inf))


def extents(run: Run, *, axis: int) -> tuple[Series, Series]:
    """Return the least and greatest coordinate of each tracked block on an axis, (T, N), units.

    Args:
        axis: 0 east, 1 north, 2 up.
    """
    return reaches(run, np.eye(3)[axis])


def reaches(run: Run, direction: Series) -> tuple[Series, Series]:
    """Return the same along any direction (3,), unit length, world frame."""
    low = np.full(run.trajectory.positions.shape[:2], np.inf)
    high = -low
    for column, name in enumerate(run.trajectory.block_ids):
        block = run.machine.blocks[name]
        way = direction @ rotations(run.trajectory.quaternions[:, column])
        place = run.trajectory.positions[:, column].astype(np.float64) @ direction
        for solid in block.module.body:
            middle, reach = _along(block, solid, way)
            low[:, column] = np.minimum(low[:, column], place + middle - reach)
            high[:, column] = np.maximum(high[:, column], place + middle + reach)
    return low, high


def _along(block: "Block", solid: "Solid", way: Series) -> tuple[Series, Series]:
    """Return where a solid's middle lies from its block's shown position, and its reach, (T,).

    Args:
        way: (T, 3) the direction, block frame.
    """
    shown = np.array(block.module.center)
    if isinstance(solid, Cylinder):
        pose = solid.block_from_axis
        along = way @ np.array(pose.rotation)[:, 2]
        across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
        reach = solid.length / 2 * np.abs(along) + solid.radius * across
        return way @ (np.array(pose.position) - shown), reach
    middle = way @ (np.array(solid.center) - shown)
    if isinstance(solid, Ball):
        return middle, np.full(len(way), solid.radius)
    return middle, np.abs(way) @ (np.array(solid.size) / 2)
