"""Blocks that rest on terrain, ground or under the cargo, found from geometry.

Two rigid bodies touch in few points; tilted by a thousandth of a radian, all but one are out of
touch. A structure that bends ever so little would touch wherever its faces lie on each other, so
every block within a small gap takes part in bearing what the bodies exchange.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.engines.base import CargoPose, World, rotation_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import CARGO, WORLD, ContactForces
from buildarena_simulation.structure.model import FloatArray, IntArray, ShapeKind
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import turned

_GAP: Final = 0.04
"""Gap within which a block counts as touching, units."""

_LEVEL: Final = 0.97
"""Cosine of the greatest angle between two faces that rest on each other."""

_OVERLAP: Final = 0.01
"""Minimum overlap of faces, units."""

_FLAT: Final = 0.9
"""Cosine of the greatest angle between a face's normal and a contact's that belongs to it."""

_UPSIDE_DOWN: Final = np.diag([1.0, -1.0, -1.0])
_UP: Final = np.array([0.0, 0.0, 1.0])
_SIDES: Final = np.array([[1, 2], [0, 2], [0, 1]])
"""The axes across each axis."""

_CORNERS: Final = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class RestingFaces:
    """Faces of blocks that lie on a level rectangle of another body; B of them.

    Attributes:
        block: (B,) the blocks.
        other: (B,) `WORLD` or `CARGO`.
        surface: (B,) as in `ContactForces`.
        normal: (B, 3) from the other body to the block, world frame.
        point: (B, 3) middle of the overlap, world frame, units.
        corners: (B, 4, 3) of the overlap, world frame, units.
        area: (B,) of the overlap, units².
    """

    block: IntArray
    other: IntArray
    surface: IntArray
    normal: FloatArray
    point: FloatArray
    corners: FloatArray
    area: FloatArray

    def joined_to(self, contacts: ContactForces, cluster_of: IntArray) -> ContactForces:
        """Return the contacts with the resting faces, which take over their blocks' share.

        A contact of a resting block keeps its force, so that the patch keeps its resultant, and
        loses its weight.

        Args:
            contacts: Contacts that an engine reports.
            cluster_of: (N,) cluster of each block.
        """
        if not len(self.block):
            return contacts
        count = len(cluster_of)
        normal, weight = contacts.normal.copy(), contacts.weight.copy()
        # Rests of the world come first in the tables, rests of the cargo after them.
        after = np.where(self.other == WORLD, 0, count)
        of_cluster, rests = np.zeros((2 * count, 3)), np.zeros(2 * count, dtype=bool)
        of_cluster[cluster_of.take(self.block) + after] = self.normal
        rests[self.block + after] = True
        rows = (contacts.other < 0).nonzero()[0]
        block, after = contacts.block.take(rows), np.where(contacts.other == WORLD, 0, count)
        after = after.take(rows)
        keys = of_cluster.take(cluster_of.take(block) + after, 0)
        flat = (np.add.reduce(keys * normal.take(rows, 0), axis=1) > _FLAT).nonzero()[0]
        rows = rows.take(flat)
        normal[rows] = keys.take(flat, 0)
        weight[rows[rests.take((block + after).take(flat))]] = 0.0
        return ContactForces(
            block=np.concatenate([contacts.block, self.block]),
            other=np.concatenate([contacts.other, self.other]),
            surface=np.concatenate([contacts.surface, self.surface]),
            weight=np.concatenate([weight, np.ones(len(self.block))]),
            area=np.concatenate([contacts.area, self.area]),
            normal=np.concatenate([normal, self.normal]),
            point=np.concatenate([contacts.point, self.point]),
            force=np.concatenate([contacts.force, np.zeros((len(self.block), 3))]),
        )


_NONE: Final = RestingFaces(
    block=np.zeros(0, dtype=np.int64),
    other=np.zeros(0, dtype=np.int64),
    surface=np.zeros(0, dtype=np.int64),
    normal=np.zeros((0, 3)),
    point=np.zeros((0, 3)),
    corners=np.zeros((0, 4, 3)),
    area=np.zeros(0),
)


class FaceFinder:
    """Finds the resting faces of a world.

    Args:
        world: Terrain, ground and the machine; of its blocks, structural boxes count.
    """

    def __init__(self, world: World) -> None:
        parts = world.structure.parts
        boxes = [
            i
            for i, part in enumerate(parts)
            if part.physics.structural and part.shapes[0].kind is ShapeKind.BOX
        ]
        shapes = [parts[i].shapes[0] for i in boxes]
        self._block = np.array(boxes, dtype=np.int64)
        self._center = np.array([shape.center for shape in shapes]).reshape(-1, 3)
        self._rotation = np.array([shape.rotation for shape in shapes]).reshape(-1, 3, 3)
        self._half = np.array([shape.half_extents for shape in shapes]).reshape(-1, 3)
        self._volume = self._half.prod(axis=1)
        self._farthest = np.linalg.norm(self._half, axis=1) + _GAP
        tops = [
            (k, [*box.center[:2], box.center[2] + box.size[2] / 2], np.array(box.size[:2]) / 2)
            for k, box in enumerate(world.terrain, 1)
            if not box.slope_deg and not box.heading_deg
        ]
        if world.ground:
            tops.insert(0, (0, [0.0, 0.0, 0.0], np.array([1e6, 1e6])))
        self._surface = np.array([k for k, _, _ in tops], dtype=np.int64)
        self._top = np.array([top for _, top, _ in tops]).reshape(-1, 3)
        self._size = np.array([size for _, _, size in tops]).reshape(-1, 2)
        flat = world.cargo is not None and not world.cargo.is_ball
        self._cargo_half = world.cargo.size / 2 if world.cargo is not None and flat else None

    def find(self, clusters: Clusters, motion: Motion, cargo: CargoPose | None) -> RestingFaces:
        """Return the faces that rest now.

        Args:
            cargo: Pose of the cargo, if there is one.
        """
        c = clusters.cluster_of.take(self._block)
        turns = motion.rotation.take(c, 0)
        center = motion.position.take(c, 0) + turned(turns, self._center)
        top, boxes = self._near(center[:, 2] - self._top[:, 2:])
        frame = None
        if cargo is not None and self._cargo_half is not None:
            axes = rotation_of(cargo.quaternion) @ _UPSIDE_DOWN
            bottom = cargo.position + axes[:, 2] * self._cargo_half[2]
            under = self._near(((center - bottom) @ axes[:, 2])[None])[1]
            frame = (bottom, axes) if len(under) else None
        if not len(boxes) and frame is None:
            return _NONE
        # A level top's axes are the world's, which turn nothing.
        rotation = turns @ self._rotation
        local, turn = center.take(boxes, 0) - self._top.take(top, 0), rotation.take(boxes, 0)
        size = self._size.take(top, 0)
        if frame is not None and self._cargo_half is not None:
            bottom, axes = frame
            local = np.concatenate([local, (center.take(under, 0) - bottom) @ axes])
            turn = np.concatenate([turn, axes.T @ rotation.take(under, 0)])
            size = np.concatenate([size, self._cargo_half[None, :2].repeat(len(under), axis=0)])
            boxes = np.concatenate([boxes, under])
        return self._resting(boxes, (local, turn, size), top, frame)

    def _near(self, height: FloatArray) -> tuple[IntArray, IntArray]:
        """Return plane and box of each box whose middle is at (S, B) heights just above a plane."""
        plane, box = ((height > 0.0) & (height < self._farthest)).nonzero()
        return plane, box

    def _resting(
        self,
        box: IntArray,
        places: tuple[FloatArray, FloatArray, FloatArray],
        top: IntArray,
        frame: tuple[FloatArray, FloatArray] | None,
    ) -> RestingFaces:
        """Return the faces of the boxes that rest on a rectangle each.

        Args:
            box: (R,) the boxes, those above level tops first.
            places: Each box's middle (R, 3) and axes (R, 3, 3) in its rectangle's frame, whose
                third axis points to the box, and half-extents (R, 2) of that rectangle.
            top: The level tops; the other rows are the cargo's.
            frame: Middle (3,) and axes (3, 3) of the cargo's underside; None without such rows.
        """
        local, turn, size = places
        half, along = self._half.take(box, 0), np.abs(turn)
        cosines = along[:, 2]
        reach = np.add.reduce(cosines * half, axis=1)
        across = (along[:, :2] @ half[:, :, None])[:, :, 0]
        low = np.maximum(local[:, :2] - across, -size)
        wide = np.minimum(local[:, :2] + across, size) - low
        touches = np.abs(local[:, 2] - reach) < _GAP
        touches &= np.maximum.reduce(cosines, axis=1) > _LEVEL
        touches &= np.minimum.reduce(wide, axis=1) > _OVERLAP
        rows = touches.nonzero()[0]
        if not len(rows):
            return _NONE
        box, local, turn = box.take(rows), local.take(rows, 0)[:, :2], turn.take(rows, 0)
        half, size, low, wide, across, cosines = (
            each.take(rows, 0) for each in (half, size, low, wide, across, cosines)
        )
        down = cosines.argmax(axis=1)
        corners = _corners(local, turn, half, size, down)
        middle = (low + np.minimum(local + across, size)) / 2
        # A turned face is smaller than its bounding rectangle; its overlap in proportion.
        face = self._volume.take(box) / half[np.arange(len(rows)), down]
        count = int(np.searchsorted(rows, len(top)))
        top = top.take(rows[:count])
        other = np.full(len(rows), WORLD, dtype=np.int64)
        surface = np.full(len(rows), -1, dtype=np.int64)
        surface[:count] = self._surface.take(top)
        spots = np.zeros((len(rows), 6, 3))
        spots[:, 0] = _UP
        spots[:, 1, :2], spots[:, 2:, :2] = middle, corners
        spots[:count, 1:] += self._top.take(top, 0)[:, None]
        if frame is not None:
            (bottom, axes), plane = frame, frame[1][:, :2].T
            other[count:] = CARGO
            spots[count:, 0] = axes[:, 2]
            spots[count:, 1] = bottom + middle[count:] @ plane
            spots[count:, 2:] = bottom + corners[count:] @ plane
        return RestingFaces(
            block=self._block.take(box),
            other=other,
            surface=surface,
            normal=spots[:, 0],
            point=spots[:, 1],
            corners=spots[:, 2:],
            area=wide[:, 0] * wide[:, 1] * (face / (across[:, 0] * across[:, 1])),
        )


def _corners(
    local: FloatArray, turn: FloatArray, half: FloatArray, size: FloatArray, down: IntArray
) -> FloatArray:
    """Return corners of the lower faces, moved onto their rectangles if they overhang, (R, 4, 2).

    Args:
        local: (R, 2) middles of boxes, in the rectangles' frames.
        turn: (R, 3, 3) their axes there.
        half: (R, 3) their half-extents.
        size: (R, 2) half-extents of the rectangles.
        down: (R,) which of a box's axes is upright.
    """
    sides, rows = _SIDES[down], np.arange(len(local))[:, None]
    along = half[rows, sides][:, :, None] * turn[:, :2].transpose(0, 2, 1)[rows, sides]
    offset = _CORNERS[:, :1] * along[:, None, 0] + _CORNERS[:, 1:] * along[:, None, 1]
    ends = size[:, None]
    return np.asarray(np.minimum(np.maximum(local[:, None] + offset, -ends), ends))
