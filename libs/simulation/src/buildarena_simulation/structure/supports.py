"""Loads of terrain on a structure that bends: unilateral supports on an elastic structure.

Ground and terrain push on one cluster with a known resultant; the structure's stiffness distributes
it to the blocks. A beam that sags over a gap rests on the gap's edges and leaves its far ends
without load, however long it is. So the normal forces f >= 0 at the corners of all resting faces
are those of least elastic energy among all that have the same resultant force and moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from buildarena_simulation.structure.contacts import WORLD, ContactForces, PointForces, together
from buildarena_simulation.structure.least_energy import LeastEnergy
from buildarena_simulation.structure.model import FloatArray, IntArray
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross

_FOUNDATION: Final = 1e6
"""Stiffness of the ground under a corner: a hundred times a joint's, so that edges are sharp."""

_STILL: Final = 2e-3
"""Motion in the machine frame below which points count as unmoved, units."""

_NEGLIGIBLE: Final = 20.0
"""Resultant times its reach below which no joint can break, mass·g·unit."""


class ElasticStructure(Protocol):
    """Interface to the structure's elasticity; see `LoadModel`."""

    def displacements(self, forces: PointForces, motion: Motion) -> FloatArray:
        """Return each block's displacement and turn by forces, (N, 6), in its cluster's axes."""

    def flexibility(self, blocks: IntArray) -> FloatArray:
        """Return the displacements of blocks under unit wrenches on them, (B, 6, B, 6)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Candidates:
    """Points of one cluster that may be loaded; P of them.

    Attributes:
        block: (P,) block of each point.
        point: (P, 3) world frame, units.
        surface: (P,) see `ContactForces`.
        base: (P,) force of the even spread, mass·g.
    """

    block: IntArray
    point: FloatArray
    surface: IntArray
    base: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """Contact forces on blocks; K of them.

    Attributes:
        other: (K,) see `ContactForces`.
        surface: (K,) see `ContactForces`.
    """

    other: IntArray
    surface: IntArray
    forces: PointForces


class EdgeSupports:
    """Finds how ground and terrain share a structure's weight among its blocks.

    Args:
        centers: (N, 3) centres of mass of the blocks, machine frame, units.
        cluster_of: (N,) cluster of each block.
        gravity: Downward acceleration, units/s².
    """

    def __init__(self, centers: FloatArray, cluster_of: IntArray, *, gravity: float) -> None:
        self._centers, self._cluster_of, self._gravity = centers, cluster_of, gravity
        self._systems: dict[int, _System] = {}

    def settled(
        self,
        contacts: ContactForces,
        spread: PointForces,
        *,
        corners: FloatArray,
        structure: ElasticStructure,
        motion: Motion,
        further_forces: Sequence[PointForces],
    ) -> Settled:
        """Return the contacts' forces, the terrain's distributed by the structure's elasticity.

        Args:
            contacts: Contacts, resting faces last.
            spread: Their forces, spread evenly.
            corners: (B, 4, 3) of the resting faces, world frame, units.
            further_forces: Further forces on the blocks: thrust, ropes.

        Returns:
            Forces; the first rows are the contacts'.
        """
        first_face = len(contacts.block) - len(corners)
        patches: list[tuple[IntArray, _Candidates]] = []
        of = self._cluster_of.take(contacts.block)
        on_world = contacts.other == WORLD
        for c in sorted(set(of[first_face:][on_world[first_face:]].tolist())):
            rows = _patch(contacts, (on_world & (of == c)).nonzero()[0], first_face)
            candidates = _candidates(contacts, spread, corners, rows, first_face)
            if (candidates.block != candidates.block[0]).any() and self._matters(candidates):
                patches.append((rows, candidates))
        if not patches:
            return Settled(other=contacts.other, surface=contacts.surface, forces=spread)
        displaced = structure.displacements(together([spread, *further_forces]), motion)
        force = spread.force.copy()
        added: list[tuple[_Candidates, FloatArray]] = []
        for rows, candidates in patches:
            normal = contacts.normal[rows[-1]]
            pushes = self._pushes(candidates, normal, structure, motion, displaced)
            if pushes is not None:
                pushed = force.take(rows, 0)
                force[rows] = pushed - (pushed @ normal)[:, None] * normal
                added.append((candidates, pushes[:, None] * normal))
        return _with(
            contacts, PointForces(block=spread.block, point=spread.point, force=force), added
        )

    def _matters(self, candidates: _Candidates) -> bool:
        point = candidates.point
        reach = float((np.maximum.reduce(point) - np.minimum.reduce(point)).max())
        return abs(float(candidates.base.sum())) / self._gravity * reach > _NEGLIGIBLE

    def _pushes(
        self,
        candidates: _Candidates,
        normal: FloatArray,
        structure: ElasticStructure,
        motion: Motion,
        displaced: FloatArray,
    ) -> FloatArray | None:
        """Return the force at each point, (P,), mass·unit/s²; None to keep the even spread."""
        block, base = candidates.block, candidates.base / self._gravity
        c = int(self._cluster_of[block[0]])
        turn = motion.rotation[c]
        inward = turn.T @ normal
        local = (candidates.point - motion.position[c]) @ turn
        unit = np.empty((len(block), 6))
        unit[:, :3] = inward
        unit[:, 3:] = cross(local - self._centers.take(block, 0), inward[None])
        system = self._system(c, block, unit, local, structure)
        gap = np.add.reduce(unit * displaced.take(block, 0), axis=1) + base / _FOUNDATION
        force = system.solver.solve(system.compliance @ base - gap, base)
        return None if force is None else force * self._gravity

    def _system(
        self,
        c: int,
        block: IntArray,
        unit: FloatArray,
        local: FloatArray,
        structure: ElasticStructure,
    ) -> "_System":
        """Return the compliance of points to forces at each other, cached while they hardly move.

        Args:
            c: Cluster of the points.
            block: (P,) block of each point.
            unit: (P, 6) wrench of a unit force there on its block.
            local: (P, 3) the points, machine frame, units.
        """
        system = self._systems.get(c)
        if system is not None and system.block.tobytes() == block.tobytes():
            blocks, place = system.blocks, system.place
        else:
            blocks, place = np.unique(block, return_inverse=True)
        flexible = structure.flexibility(blocks)
        if (
            system is not None
            and system.flexible is flexible
            and system.unit.shape == unit.shape
            and np.abs(system.unit - unit).max() < _STILL
        ):
            return system
        compliance = _condensed(flexible, place, unit)
        compliance[np.diag_indices(len(compliance))] += 1.0 / _FOUNDATION
        middle = local.mean(axis=0)
        reach = max(float(np.abs(local - middle).max()), 1.0)
        across = _across(unit[0, :3]) @ (local - middle).T / reach
        balance = np.concatenate([np.ones((1, len(local))), across])
        self._systems[c] = _System(
            block=block,
            blocks=blocks,
            place=place,
            flexible=flexible,
            unit=unit,
            compliance=compliance,
            solver=LeastEnergy(compliance, balance),
        )
        return self._systems[c]


@dataclass(frozen=True, slots=True, kw_only=True)
class _System:
    """Points of one cluster that may be loaded, and their compliance.

    Attributes:
        block: (P,) block of each point.
        blocks: (B,) each block once.
        place: (P,) index of each point's block among them.
        flexible: Source of `compliance`.
        unit: (P, 6) unit wrenches used for it.
        compliance: (P, P) displacement of each point under a unit force at each.
        solver: Solver that distributes a resultant to the points.
    """

    block: IntArray
    blocks: IntArray
    place: IntArray
    flexible: FloatArray
    unit: FloatArray
    compliance: FloatArray
    solver: LeastEnergy


def _condensed(flexible: FloatArray, place: IntArray, unit: FloatArray) -> FloatArray:
    """Return the product unit · flexible · unit over the blocks' degrees of freedom, (P, P).

    Args:
        flexible: (B, 6, B, 6) flexibility of the blocks.
        place: (P,) the points' blocks, indices below B.
        unit: (P, 6).
    """
    count, points = len(flexible), len(place)
    order = np.argsort(place, kind="stable")
    start = np.searchsorted(place[order], np.arange(count))
    slot = np.empty(points, dtype=np.int64)
    slot[order] = np.arange(points) - start[place[order]]
    slots = int(slot.max()) + 1
    units = np.zeros((count, 6, slots))
    units[place, :, slot] = unit
    loaded = flexible.reshape(6 * count, count, 6).transpose(1, 0, 2) @ units
    yields = loaded.transpose(1, 0, 2).reshape(count, 6, count * slots)
    table = (units.transpose(0, 2, 1) @ yields).reshape(count * slots, count * slots)
    where = place * slots + slot
    return np.asarray(table[np.ix_(where, where)])


def _patch(contacts: ContactForces, rows: IntArray, first_face: int) -> IntArray:
    """Return a cluster's contacts with the world along the normal of its resting faces."""
    normal = contacts.normal.take(rows, 0)
    along = normal[np.searchsorted(rows, first_face)]
    return np.asarray(rows[np.logical_and.reduce(normal == along, axis=1)])


def _candidates(
    contacts: ContactForces,
    spread: PointForces,
    corners: FloatArray,
    rows: IntArray,
    first_face: int,
) -> _Candidates:
    """Return corners of resting faces and other contact points among some rows."""
    pushes = spread.force.take(rows, 0) * contacts.normal.take(rows, 0)
    along = np.add.reduce(pushes, axis=1)
    count = int(np.searchsorted(rows, first_face))
    weighted = (contacts.weight.take(rows[:count]) > 0.0).nonzero()[0]
    faces, points = rows[count:], rows[weighted]
    return _Candidates(
        block=_of_corners(contacts.block, faces, points),
        point=np.concatenate(
            [corners.take(faces - first_face, 0).reshape(-1, 3), contacts.point.take(points, 0)]
        ),
        surface=_of_corners(contacts.surface, faces, points),
        base=np.concatenate([(along[count:] / 4).repeat(4), along.take(weighted)]),
    )


def _of_corners(of: IntArray, faces: IntArray, points: IntArray) -> IntArray:
    """Return values for the four corners of faces, and then for points."""
    return np.concatenate([of.take(faces).repeat(4), of.take(points)])


def _across(axis: FloatArray) -> FloatArray:
    """Return two unit vectors across an axis and each other, (2, 3)."""
    helper = np.eye(3)[int(np.abs(axis).argmin())]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def _with(
    contacts: ContactForces, spread: PointForces, added: Sequence[tuple[_Candidates, FloatArray]]
) -> Settled:
    """Return the forces of the contacts and further ones on ground and terrain."""
    if not added:
        return Settled(other=contacts.other, surface=contacts.surface, forces=spread)
    more = [points for points, _ in added]
    world = np.full(sum(len(points.block) for points in more), WORLD, dtype=np.int64)
    return Settled(
        other=np.concatenate([contacts.other, world]),
        surface=np.concatenate([contacts.surface, *(points.surface for points in more)]),
        forces=PointForces(
            block=np.concatenate([spread.block, *(points.block for points in more)]),
            point=np.concatenate([spread.point, *(points.point for points in more)]),
            force=np.concatenate([spread.force, *(force for _, force in added)]),
        ),
    )
