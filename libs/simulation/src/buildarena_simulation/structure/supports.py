"""How terrain bears a structure that bends: unilateral supports on an elastic structure.

Ground and terrain push on one cluster with a known resultant; the structure's own stiffness decides
how much of it each block gets. A beam that sags over a gap rests on the gap's edges and leaves its
far ends without load, however long it is. So the normal forces f >= 0 at the corners of all resting
faces are those of least elastic energy among all that have the same resultant force and moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from buildarena_simulation.structure.contacts import (
    WORLD,
    ContactForces,
    PointForces,
    joined,
    together,
)
from buildarena_simulation.structure.model import BoolArray, FloatArray, IntArray
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross

_FOUNDATION: Final = 1e6
"""Stiffness of the ground under a corner: a hundred times a joint's, so that edges are sharp."""

_SOFTNESS: Final = 1e-9
"""Lets resultants through that points in a line cannot bear; negligible else."""

_ROUNDS: Final = 12
_TOLERANCE: Final = 1e-9
"""A pull below this share of the resultant is none."""

_CLOSED: Final = 1e-10
"""The same for a gap, per mass·g of the resultant: a thousandth of what the ground yields."""

_MISMATCH: Final = 1e-3
"""Share of the resultant that may be missed before the even spread is kept."""

_STILL: Final = 2e-3
"""Points that moved less than this in the machine frame are where they were, units."""

_NEGLIGIBLE: Final = 20.0
"""A resultant times its reach below this breaks no joint, mass·g·unit."""


class ElasticStructure(Protocol):
    """What is asked of the structure; see `LoadModel`."""

    def displacements(self, forces: PointForces, motion: Motion) -> FloatArray:
        """Displacement and turn of every block under forces, (N, 6), in its cluster's axes."""

    def flexibility(self, blocks: IntArray) -> FloatArray:
        """Displacements of blocks under unit wrenches on them, (B, 6, B, 6)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Candidates:
    """Points of one cluster that may bear load; P of them.

    Attributes:
        block: (P,) block each belongs to.
        point: (P, 3) world frame, units.
        surface: (P,) as in `ContactForces`.
        base: (P,) force of the even spread, mass·g.
    """

    block: IntArray
    point: FloatArray
    surface: IntArray
    base: FloatArray


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
        others: Sequence[PointForces],
    ) -> tuple[ContactForces, PointForces]:
        """The contacts with the terrain's forces where an elastic structure would take them.

        Args:
            contacts: The contacts, resting faces last.
            spread: Their forces, spread evenly.
            corners: (B, 4, 3) of the resting faces, world frame, units.
            structure: The structure.
            motion: Motion of the clusters.
            others: Further forces on the blocks: thrust, ropes.

        Returns:
            Contacts and forces, one row each; the first rows are those given.
        """
        first_face = len(contacts.block) - len(corners)
        patches: list[tuple[IntArray, _Candidates]] = []
        of = self._cluster_of[contacts.block]
        resting = contacts.other[first_face:] == WORLD
        for c in sorted(set(of[first_face:][resting].tolist())):
            rows = self._patch(contacts, of, first_face, c)
            candidates = _candidates(contacts, spread, corners, rows, first_face)
            if (candidates.block != candidates.block[0]).any() and self._matters(candidates):
                patches.append((rows, candidates))
        if not patches:
            return contacts, spread
        displaced = structure.displacements(together([spread, *others]), motion)
        force = spread.force.copy()
        added: list[tuple[_Candidates, FloatArray]] = []
        for rows, candidates in patches:
            normal = contacts.normal[rows[-1]]
            pushes = self._pushes(candidates, normal, structure, motion, displaced)
            if pushes is not None:
                along = force[rows] @ normal
                force[rows] -= along[:, None] * normal
                added.append((candidates, pushes[:, None] * normal))
        return _with(
            contacts, PointForces(block=spread.block, point=spread.point, force=force), added
        )

    def _patch(self, contacts: ContactForces, of: IntArray, first_face: int, c: int) -> IntArray:
        """Rows of a cluster's contacts with the world along the normal of its resting faces."""
        mine: IntArray = ((of == c) & (contacts.other == WORLD)).nonzero()[0]
        normal = contacts.normal[mine[mine >= first_face][0]]
        return np.asarray(mine[(contacts.normal[mine] == normal).all(axis=1)])

    def _matters(self, candidates: _Candidates) -> bool:
        reach = float(np.ptp(candidates.point, axis=0).max())
        return abs(float(candidates.base.sum())) / self._gravity * reach > _NEGLIGIBLE

    def _pushes(
        self,
        candidates: _Candidates,
        normal: FloatArray,
        structure: ElasticStructure,
        motion: Motion,
        displaced: FloatArray,
    ) -> FloatArray | None:
        """Force at each point, (P,), mass·unit/s²; None where the even spread has to do."""
        block, point, base = candidates.block, candidates.point, candidates.base / self._gravity
        c = self._cluster_of[block[0]]
        turn = motion.rotation[c]
        inward = turn.T @ normal
        local = (point - motion.position[c]) @ turn
        moments = cross(local - self._centers[block], inward[None])
        unit = np.concatenate([np.full((len(block), 3), inward), moments], axis=1)
        known = self._system(block, unit, local, structure)
        gap = (unit * displaced[block]).sum(axis=1) + base / _FOUNDATION
        force = known.solver.solve(known.compliance @ base - gap, base)
        return None if force is None else force * self._gravity

    def _system(
        self, block: IntArray, unit: FloatArray, local: FloatArray, structure: ElasticStructure
    ) -> "_System":
        """How points yield to forces at each other; remembered while they hardly move.

        Args:
            block: (P,) block of each point.
            unit: (P, 6) wrench of a unit force there on its block.
            local: (P, 3) the points, machine frame, units.
            structure: The structure.
        """
        blocks, place = np.unique(block, return_inverse=True)
        flexible = structure.flexibility(blocks)
        cluster = int(self._cluster_of[block[0]])
        known = self._systems.get(cluster)
        if (
            known is not None
            and known.flexible is flexible
            and known.unit.shape == unit.shape
            and np.abs(known.unit - unit).max() < _STILL
        ):
            return known
        compliance = _condensed(flexible, place, unit)
        compliance[np.diag_indices(len(compliance))] += 1.0 / _FOUNDATION
        middle = local.mean(axis=0)
        reach = max(float(np.abs(local - middle).max()), 1.0)
        across = _across(unit[0, :3]) @ (local - middle).T / reach
        balance = np.concatenate([np.ones((1, len(local))), across])
        self._systems[cluster] = _System(
            flexible=flexible,
            unit=unit,
            compliance=compliance,
            solver=_LeastEnergy(compliance, balance),
        )
        return self._systems[cluster]


@dataclass(frozen=True, slots=True, kw_only=True)
class _System:
    """The points of one cluster that may bear, and how they yield.

    Attributes:
        flexible: What `compliance` was made from.
        unit: (P, 6) what it was made with.
        compliance: (P, P) how far each point yields under a unit force at each.
        solver: Shares a resultant among the points.
    """

    flexible: FloatArray
    unit: FloatArray
    compliance: FloatArray
    solver: "_LeastEnergy"


def _condensed(flexible: FloatArray, place: IntArray, unit: FloatArray) -> FloatArray:
    """The product unit · flexible · unit over the blocks' degrees of freedom, (P, P).

    Args:
        flexible: (B, 6, B, 6).
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


class _LeastEnergy:
    """Finds the f >= 0 that minimises f·h·f / 2 - target·f with the resultant of a given f.

    Args:
        h: (P, P) positive definite.
        balance: (3, P) from forces to resultant.
    """

    def __init__(self, h: FloatArray, balance: FloatArray) -> None:
        self._h, self._balance = h, balance
        self._bearing: BoolArray = np.ones(len(h), dtype=bool)
        self._factors: tuple[bytes, object] = (b"", None)

    def solve(self, target: FloatArray, forces: FloatArray) -> FloatArray | None:
        """The forces; None if none have the resultant.

        Args:
            target: (P,).
            forces: (P,) forces with the resultant that is wanted.
        """
        bearing, wanted = self._bearing, self._balance @ forces
        scale = float(np.abs(wanted).max()) + 1e-12
        for turn in range(_ROUNDS):
            if not bearing.any():
                break
            force, opening = self._with(bearing, target, wanted)
            pulling = force < -_TOLERANCE * scale
            # A point without load opens; where it would close again, it bears.
            closing = ~bearing & (opening < -_CLOSED * scale)
            if turn >= _ROUNDS // 2:
                closing[:] = False
            if not pulling.any() and not closing.any():
                break
            bearing = (bearing & ~pulling) | closing
        else:
            force = np.maximum(force, 0.0)
        if not bearing.any() or np.abs(self._balance @ force - wanted).max() > _MISMATCH * scale:
            self._bearing = np.ones(len(bearing), dtype=bool)
            return None
        self._bearing = bearing
        return force

    def _with(
        self, bearing: BoolArray, target: FloatArray, wanted: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Forces of points that bear, and how far the others open, each (P,)."""
        from scipy.linalg import lu_factor, lu_solve

        held = bearing.nonzero()[0]
        size = len(held)
        if self._factors[0] != bearing.tobytes():
            matrix = np.zeros((size + 3, size + 3))
            matrix[:size, :size] = self._h[np.ix_(held, held)]
            matrix[:size, size:] = self._balance[:, held].T
            matrix[size:, :size] = self._balance[:, held]
            matrix[size:, size:] = -_SOFTNESS * np.eye(3)
            self._factors = (bearing.tobytes(), lu_factor(matrix, check_finite=False))
        right = np.concatenate([target[held], wanted])
        solution = lu_solve(self._factors[1], right, check_finite=False)
        force = np.zeros(len(target))
        force[held] = solution[:size]
        opening = self._h @ force - target + solution[size:] @ self._balance
        return force, opening


def _candidates(
    contacts: ContactForces,
    spread: PointForces,
    corners: FloatArray,
    rows: IntArray,
    first_face: int,
) -> _Candidates:
    """Corners of the resting faces and points of what else touches, among some rows."""
    along = (spread.force[rows] * contacts.normal[rows]).sum(axis=1)
    face = rows >= first_face
    weighted = contacts.weight[rows] > 0.0
    faces, points = rows[face], rows[~face & weighted]
    return _Candidates(
        block=np.concatenate([np.repeat(contacts.block[faces], 4), contacts.block[points]]),
        point=np.concatenate([corners[faces - first_face].reshape(-1, 3), contacts.point[points]]),
        surface=np.concatenate([np.repeat(contacts.surface[faces], 4), contacts.surface[points]]),
        base=np.concatenate([np.repeat(along[face] / 4, 4), along[~face & weighted]]),
    )


def _across(axis: FloatArray) -> FloatArray:
    """Two unit vectors across an axis and each other, (2, 3)."""
    helper = np.eye(3)[int(np.abs(axis).argmin())]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def _with(
    contacts: ContactForces, spread: PointForces, added: Sequence[tuple[_Candidates, FloatArray]]
) -> tuple[ContactForces, PointForces]:
    """The contacts and forces with further rows."""
    if not added:
        return contacts, spread
    block = np.concatenate([points.block for points, _ in added])
    point = np.concatenate([points.point for points, _ in added])
    surface = np.concatenate([points.surface for points, _ in added])
    force = np.concatenate([forces for _, forces in added])
    count = len(block)
    more = ContactForces(
        block=block,
        other=np.full(count, WORLD, dtype=np.int64),
        surface=surface,
        weight=np.ones(count),
        area=np.zeros(count),
        normal=np.full((count, 3), [0.0, 0.0, 1.0]),
        point=point,
        force=force,
    )
    return (
        joined([contacts, more]),
        together([spread, PointForces(block=block, point=point, force=force)]),
    )
