"""Assignment of contacts to blocks of a cluster, for engines that name only the body."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.solids import collision_half_extents

_TIE: Final = 0.02
"""A contact within this distance of several blocks is shared among them, units."""

_CANDIDATES: Final = 16
"""Blocks considered for one contact: more than can meet in a point."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeTable:
    """The collision shapes of one cluster; S of them.

    Attributes:
        block: (S,) block each belongs to.
        center: (S, 3) machine frame, units.
        rotation: (S, 3, 3) machine_from_shape.
        half: (S, 3) half-extents as the engine has them, units.
    """

    block: IntArray
    center: FloatArray
    rotation: FloatArray
    half: FloatArray

    def share(self, points: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Assign points on the cluster's surface to the nearest blocks.

        Args:
            points: (K, 3) machine frame, units.

        Returns:
            Rows of one point and one block each: the point's index, the block, and its share.
        """
        block, center, rotation, half = self.block, self.center, self.rotation, self.half
        if few := len(block) <= _CANDIDATES:
            offset = points[:, None] - center
        else:
            nearby = self._nearby(points)
            block, rotation, half = block[nearby], rotation[nearby], half[nearby]
            offset = points[:, None] - center[nearby]
        outside = np.maximum(np.abs((offset[:, :, None] @ rotation)[:, :, 0]) - half, 0.0)
        distance = np.sqrt(np.add.reduce(outside * outside, axis=2))
        is_near = distance <= np.minimum.reduce(distance, axis=1)[:, None] + _TIE
        row, column = is_near.nonzero()
        weight = 1.0 / np.add.reduce(is_near, axis=1).take(row)
        return row, block.take(column) if few else block[row, column], weight

    def _nearby(self, points: FloatArray) -> IntArray:
        """Return the shapes whose centres are nearest to each point, (K, 16)."""
        squares = (self.center * self.center).sum(axis=1) - 2.0 * points @ self.center.T
        return np.argpartition(squares, _CANDIDATES, axis=1)[:, :_CANDIDATES]


def shape_table(structure: Structure, blocks: Sequence[int] | IntArray) -> ShapeTable:
    """Return the shapes of some blocks."""
    owned = [(int(i), shape) for i in blocks for shape in structure.parts[i].shapes]
    return ShapeTable(
        block=np.array([i for i, _ in owned], dtype=np.int64),
        center=np.array([shape.center for _, shape in owned]),
        rotation=np.array([shape.rotation for _, shape in owned]),
        half=np.array([collision_half_extents(shape) for _, shape in owned]),
    )
