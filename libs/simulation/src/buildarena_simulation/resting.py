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
"""Faces overlap by at least this much, units."""

_FLAT: Final = 0.9
"""Cosine of the greatest angle between a face's normal and a contact's that belongs to it."""

_NONE: Final[tuple[np.ndarray, ...]] = (
    *(np.zeros(0, dtype=np.int64) for _ in range(3)),
    *(np.zeros((0, *shape)) for shape in ((3,), (3,), (4, 3), ())),
)
"""The columns of `RestingFaces` where nothing rests."""

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
        """The contacts with the resting faces among them, which take over their blocks' share.

        A contact of a resting block keeps its force, so that the patch keeps its resultant, and
        loses its weight.

        Args:
            contacts: What an engine reports.
            cluster_of: (N,) cluster of each block.
        """
        if not len(self.block):
            return contacts
        count = len(cluster_of)
        normal, weight = contacts.normal.copy(), contacts.weight.copy()
        for number in (WORLD, CARGO):
            mine = (self.other == number).nonzero()[0]
            rows = (contacts.other == number).nonzero()[0]
            if not len(mine) or not len(rows):
                continue
            of_cluster = np.zeros((count, 3))
            of_cluster[cluster_of[self.block[mine]]] = self.normal[mine]
            wanted = of_cluster[cluster_of[contacts.block[rows]]]
            flat = (wanted * normal[rows]).sum(axis=1) > _FLAT
            rows, wanted = rows[flat], wanted[flat]
            normal[rows] = wanted
            rests = np.zeros(count, dtype=bool)
            rests[self.block[mine]] = True
            weight[rows[rests[contacts.block[rows]]]] = 0.0
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
        self._farthest = np.linalg.norm(self._half, axis=1) + _GAP
        self._tops = [
            (
                k,
                np.array([*box.center[:2], box.center[2] + box.size[2] / 2]),
                np.array(box.size) / 2,
            )
            for k, box in enumerate(world.terrain, 1)
            if not box.slope_deg and not box.heading_deg
        ]
        if world.ground:
            self._tops.insert(0, (0, np.zeros(3), np.array([1e6, 1e6, 0.0])))
        flat = world.cargo is not None and not world.cargo.is_ball
        self._cargo_half = world.cargo.size / 2 if world.cargo is not None and flat else None

    def find(self, clusters: Clusters, motion: Motion, cargo: CargoPose | None) -> RestingFaces:
        """The faces that rest now.

        Args:
            clusters: The clusters.
            motion: Where they are.
            cargo: Where the cargo is, if there is one.
        """
        c = clusters.cluster_of[self._block]
        center = motion.position[c] + turned(motion.rotation[c], self._center)
        rotation = motion.rotation[c] @ self._rotation
        faces = [
            self._resting(center, rotation, (top, np.eye(3), half[:2]), (WORLD, surface))
            for surface, top, half in self._tops
        ]
        if cargo is not None and self._cargo_half is not None:
            turn = rotation_of(cargo.quaternion) @ np.diag([1.0, -1.0, -1.0])
            bottom = cargo.position + turn[:, 2] * self._cargo_half[2]
            frame = (bottom, turn, self._cargo_half[:2])
            faces.append(self._resting(center, rotation, frame, (CARGO, -1)))
        faces = [columns for columns in faces if len(columns[0])] or [_NONE]
        block, other, surface, normal, point, corners, area = (
            np.concatenate(column) for column in zip(*faces, strict=True)
        )
        return RestingFaces(
            block=block,
            other=other,
            surface=surface,
            normal=normal,
            point=point,
            corners=corners,
            area=area,
        )

    def _resting(
        self,
        center: FloatArray,
        rotation: FloatArray,
        frame: tuple[FloatArray, FloatArray, FloatArray],
        numbers: tuple[int, int],
    ) -> tuple[np.ndarray, ...]:
        """Blocks that all but rest on a rectangle.

        Args:
            center: (B, 3) of the boxes, world frame, units.
            rotation: (B, 3, 3) world_from_box.
            frame: The rectangle's middle (3,), its axes (3, 3), the third towards the blocks, and
                its half-extents (2,).
            numbers: The rectangle's body and surface.

        Returns:
            The columns of `RestingFaces`.
        """
        middle, axes, size = frame
        height = (center - middle) @ axes[:, 2]
        near = ((height > 0.0) & (height < self._farthest)).nonzero()[0]
        if not len(near):
            return _NONE
        local, turn = (center[near] - middle) @ axes, axes.T @ rotation[near]
        cosines, half = np.abs(turn[:, 2]), self._half[near]
        reach = (cosines * half).sum(axis=1)
        across = (np.abs(turn[:, :2]) @ half[:, :, None])[:, :, 0]
        low = np.maximum(local[:, :2] - across, -size)
        high = np.minimum(local[:, :2] + across, size)
        wide = high - low > _OVERLAP
        touching = (
            (np.abs(local[:, 2] - reach) < _GAP)
            & (cosines.max(axis=1) > _LEVEL)
            & wide[:, 0]
            & wide[:, 1]
        ).nonzero()[0]
        if not len(touching):
            return _NONE
        rows = near[touching]
        corners = self._corners(local[touching], turn[touching], half[touching], size)
        plane = axes[:, :2].T
        count = len(rows)
        # A turned face is smaller than its bounding rectangle; its overlap in proportion.
        face = (
            half.prod(axis=1)[touching]
            / half[np.arange(len(half)), cosines.argmax(axis=1)][touching]
        )
        share = face / across[touching].prod(axis=1)
        return (
            self._block[rows],
            np.full(count, numbers[0], dtype=np.int64),
            np.full(count, numbers[1], dtype=np.int64),
            np.full((count, 3), axes[:, 2]),
            middle + ((low + high) / 2)[touching] @ plane,
            middle + corners @ plane,
            (high - low)[touching].prod(axis=1) * share,
        )

    def _corners(
        self, local: FloatArray, turn: FloatArray, half: FloatArray, size: FloatArray
    ) -> FloatArray:
        """Corners of the lower faces, moved onto the rectangle where they overhang, (B, 4, 2)."""
        down = np.abs(turn[:, 2]).argmax(axis=1)
        sides = np.array([[1, 2], [0, 2], [0, 1]])[down]
        rows = np.arange(len(local))[:, None]
        reach = half[rows, sides]
        axes = np.moveaxis(turn[:, :2], 1, 2)[rows, sides]
        offset = (_CORNERS[None, :, :, None] * (reach[..., None] * axes)[:, None]).sum(axis=2)
        return np.asarray(np.clip(local[:, None, :2] + offset, -size, size))
