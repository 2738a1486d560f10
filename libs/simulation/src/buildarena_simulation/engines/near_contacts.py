"""Contacts with a small gap, for engines that report only what overlaps.

Two rigid bodies touch in few points; one of them tilted by a thousandth of a radian, the others are
out of touch. A structure that bends ever so little would touch with all of them, so blocks within
that gap count as touching, with no force of their own yet, and take part in the even sharing.
"""

from typing import Final

import numpy as np

from buildarena_simulation.engines.base import CargoPose, World, rotation_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.model import FloatArray, IntArray, ShapeKind
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import turned

_GAP: Final = 0.04
"""Gap within which a block counts as touching, units."""

_LEVEL: Final = 0.97
"""Cosine of the greatest angle between two faces that rest on each other."""

_OVERLAP: Final = 0.1
"""Faces overlap by at least this much, units."""


class NearContacts:
    """Finds the blocks of a world that all but touch terrain, ground or cargo.

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
        level = [box for box in world.terrain if not box.slope_deg]
        tops = [(box.center[2] + box.size[2] / 2, box.center[:2], box.size[:2]) for box in level]
        if world.ground:
            tops.append((0.0, (0.0, 0.0), (1e6, 1e6)))
        self._tops = [
            (height, np.array(middle), np.array(size) / 2) for height, middle, size in tops
        ]
        self._cargo_half = None if world.cargo is None else world.cargo.size / 2

    def beside(
        self,
        contacts: ContactForces,
        clusters: Clusters,
        motion: Motion,
        cargo: CargoPose | None,
        *,
        world: int,
        cargo_number: int,
    ) -> ContactForces:
        """The contacts, and those with a small gap as well.

        Args:
            contacts: What the engine reports.
            clusters: The clusters.
            motion: Where they are.
            cargo: Where the cargo is.
            world: Number of ground and terrain in `ContactForces.other`.
            cargo_number: Number of the cargo there.
        """
        c = clusters.cluster_of[self._block]
        center = motion.position[c] + turned(motion.rotation[c], self._center)
        rotation = motion.rotation[c] @ self._rotation
        found = []
        for height, middle, size in self._tops:
            frame = (np.array([*middle, height]), np.eye(3), size)
            found.append(self._resting(center, rotation, frame, contacts, world))
        if cargo is not None and self._cargo_half is not None:
            turn = rotation_of(cargo.quaternion) @ np.diag([1.0, -1.0, -1.0])
            bottom = cargo.position + turn[:, 2] * self._cargo_half[2]
            frame = (bottom, turn, self._cargo_half[:2])
            found.append(self._resting(center, rotation, frame, contacts, cargo_number))
        block = np.concatenate([rows for rows, _, _, _ in found])
        if not len(block):
            return contacts
        point = np.concatenate([points for _, points, _, _ in found])
        normal = np.concatenate([normals for _, _, normals, _ in found])
        other = np.concatenate([numbers for _, _, _, numbers in found])
        return ContactForces(
            block=np.concatenate([contacts.block, block]),
            other=np.concatenate([contacts.other, other]),
            weight=np.concatenate([contacts.weight, np.ones(len(block))]),
            normal=np.concatenate([contacts.normal, normal]),
            point=np.concatenate([contacts.point, point]),
            force=np.concatenate([contacts.force, np.zeros((len(block), 3))]),
        )

    def _resting(
        self,
        center: FloatArray,
        rotation: FloatArray,
        frame: tuple[FloatArray, FloatArray, FloatArray],
        contacts: ContactForces,
        number: int,
    ) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
        """Blocks that all but rest on a rectangle and are not in touch with it yet.

        Args:
            center: (B, 3) of the boxes, world frame, units.
            rotation: (B, 3, 3) world_from_box.
            frame: The rectangle's middle (3,), its axes (3, 3), the third towards the blocks, and
                its half-extents (2,).
            contacts: What is in touch.
            number: The rectangle's body in `contacts.other`.

        Returns:
            Blocks, points, normals and the body's number, one row each.
        """
        middle, axes, size = frame
        local = (center - middle) @ axes
        cosines = np.abs(axes[:, 2] @ rotation)
        reach = (cosines * self._half).sum(axis=1)
        across = np.abs(axes[:, :2].T @ rotation) @ self._half[:, :, None]
        overlap = size + across[:, :, 0] - np.abs(local[:, :2])
        near = (
            (np.abs(local[:, 2] - reach) < _GAP)
            & (cosines.max(axis=1) > _LEVEL)
            & (overlap > _OVERLAP).all(axis=1)
        )
        touching = contacts.block[contacts.other == number]
        rows = np.flatnonzero(near & ~np.isin(self._block, touching))
        inside = np.clip(local[rows, :2], -size, size)
        point = middle + inside @ axes[:, :2].T
        normal = np.tile(axes[:, 2], (len(rows), 1))
        return self._block[rows], point, normal, np.full(len(rows), number, dtype=np.int64)
