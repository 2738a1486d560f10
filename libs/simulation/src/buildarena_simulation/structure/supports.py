"""How terrain bears a structure that bends: unilateral supports on an elastic structure.

What ground and terrain push on one cluster is known as a resultant; which block gets how much of
it is for the structure's own stiffness to say. A beam that sags over a gap leaves its far ends
without load and stands on the gap's edges, however long it is. So the normal forces f >= 0 at the
corners of all resting faces are those of least elastic energy among all that have the same
resultant force and moment.
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
_MISMATCH: Final = 1e-3
"""Share of the resultant that may be missed before the even spread is kept."""

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
        self._bearing: dict[tuple[int, ...], BoolArray] = {}

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
        found: list[tuple[IntArray, _Candidates]] = []
        of = self._cluster_of[contacts.block]
        resting = contacts.other[first_face:] == WORLD
        for c in np.unique(of[first_face:][resting]).tolist():
            rows = self._patch(contacts, of, first_face, c)
            candidates = _candidates(contacts, spread, corners, rows, first_face)
            if len(np.unique(candidates.block)) > 1 and self._matters(candidates):
                found.append((rows, candidates))
        if not found:
            return contacts, spread
        displaced = structure.displacements(together([spread, *others]), motion)
        force = spread.force.copy()
        added: list[tuple[_Candidates, FloatArray]] = []
        for rows, candidates in found:
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
        mine: IntArray = np.flatnonzero((of == c) & (contacts.other == WORLD))
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
        unit = np.concatenate([np.tile(inward, (len(block), 1)), moments], axis=1)
        blocks, place = np.unique(block, return_inverse=True)
        flexible = structure.flexibility(blocks)[place][:, :, place]
        h = np.einsum("pi,piqj,qj->pq", unit, flexible, unit, optimize=True)
        h[np.diag_indices(len(h))] += 1.0 / _FOUNDATION
        gap = (unit * displaced[block]).sum(axis=1) + base / _FOUNDATION
        middle = local.mean(axis=0)
        span = _across(inward)
        reach = max(float(np.abs(local - middle).max()), 1.0)
        balance = np.concatenate([np.ones((1, len(local))), span @ (local - middle).T / reach])
        wanted = balance @ base
        key = (*block.tolist(), len(block))
        start = self._bearing.get(key)
        solved = _least_energy(h, h @ base - gap, balance, wanted, start)
        if solved is None:
            return None
        force, self._bearing[key] = solved
        return force * self._gravity


def _least_energy(
    h: FloatArray,
    target: FloatArray,
    balance: FloatArray,
    wanted: FloatArray,
    start: BoolArray | None,
) -> tuple[FloatArray, BoolArray] | None:
    """The f >= 0 that minimises f·h·f / 2 - target·f where balance·f = wanted.

    Args:
        h: (P, P) positive definite.
        target: (P,).
        balance: (3, P) from forces to resultant.
        wanted: (3,) the resultant.
        start: (P,) the points that are likely to bear.

    Returns:
        f and the points that bear; None if no f has the resultant.
    """
    count = len(target)
    bearing = np.ones(count, dtype=bool) if start is None else start.copy()
    scale = float(np.abs(wanted).max()) + 1e-12
    force = np.zeros(count)
    for turn in range(_ROUNDS):
        held = np.flatnonzero(bearing)
        if not len(held):
            return None
        size = len(held)
        matrix = np.zeros((size + 3, size + 3))
        matrix[:size, :size] = h[np.ix_(held, held)]
        matrix[:size, size:] = balance[:, held].T
        matrix[size:, :size] = balance[:, held]
        matrix[size:, size:] = -_SOFTNESS * np.eye(3)
        solution = np.linalg.solve(matrix, np.concatenate([target[held], wanted]))
        force = np.zeros(count)
        force[held] = solution[:size]
        pulling = force < -_TOLERANCE * scale
        # A point without load opens; where it would close again, it bears.
        opening = h @ force - target + solution[size:] @ balance
        closing = (
            ~bearing & (opening < -_TOLERANCE * scale) if turn < _ROUNDS // 2 else pulling & False
        )
        if not pulling.any() and not closing.any():
            break
        bearing = (bearing & ~pulling) | closing
    force = np.maximum(force, 0.0)
    if np.abs(balance @ force - wanted).max() > _MISMATCH * scale:
        return None
    return force, bearing


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
        normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
        point=point,
        force=force,
    )
    return (
        joined([contacts, more]),
        together([spread, PointForces(block=block, point=point, force=force)]),
    )
