"""Contact forces, shared evenly over the points of each contact patch.

How the force between two rigid bodies is spread over many contact points is not determined by
statics: a solver may put it all on one corner and still be right. Joint loads depend on it, so each
patch keeps its resultant and gets the spread of least squares, the one an even elastic layer
between the bodies would give.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray

_NORMAL_GRID: Final = 4.0
"""Normals are told apart by their components rounded to quarters."""

_ROUNDS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class PointForces:
    """Forces on blocks; K of them.

    Attributes:
        block: (K,) block each acts on.
        point: (K, 3) where it acts, world frame, units.
        force: (K, 3) world frame, mass·unit/s².
    """

    block: IntArray
    point: FloatArray
    force: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactForces:
    """Contacts as an engine reports them, one row per block and point; K of them.

    Attributes:
        block: (K,) block each acts on.
        other: (K,) any number that tells the body on the other side.
        weight: (K,) share of the point that belongs to the block, above 0, at most 1.
        normal: (K, 3) unit vector from the other body to the block, world frame.
        point: (K, 3) world frame, units.
        force: (K, 3) on the block, normal and friction, world frame, mass·unit/s².
    """

    block: IntArray
    other: IntArray
    weight: FloatArray
    normal: FloatArray
    point: FloatArray
    force: FloatArray


def evenly_shared(contacts: ContactForces, cluster_of: IntArray) -> PointForces:
    """The contacts with each patch's force spread evenly.

    A patch is all contacts between one cluster and one other body with about the same normal. Its
    forces become w·(a + b × r), with a and b such that force and moment stay as they were; points
    that would have to pull are left out and the rest is spread again.

    Args:
        contacts: As reported.
        cluster_of: (N,) cluster of each block.
    """
    force = contacts.force.copy()
    if len(force) > 1:
        way = np.round(contacts.normal * _NORMAL_GRID).astype(np.int64)
        keys = np.column_stack([cluster_of[contacts.block], contacts.other, way])
        _, patch = np.unique(keys, axis=0, return_inverse=True)
        order = np.argsort(patch, kind="stable")
        edges = np.flatnonzero(np.diff(patch[order])) + 1
        for rows in np.split(order, edges):
            if len(rows) > 1:
                force[rows] = _spread(
                    contacts.point[rows],
                    force[rows],
                    contacts.weight[rows],
                    contacts.normal[rows].mean(axis=0),
                )
    return PointForces(block=contacts.block, point=contacts.point, force=force)


def _spread(
    point: FloatArray, force: FloatArray, weight: FloatArray, normal: FloatArray
) -> FloatArray:
    middle = point.mean(axis=0)
    arm = point - middle
    total = force.sum(axis=0)
    moment = np.cross(arm, force).sum(axis=0)
    kept = weight.copy()
    for _ in range(_ROUNDS):
        whole = kept.sum()
        center = kept @ arm / whole
        r = arm - center
        lever = kept * (r * r).sum(axis=1)
        inertia = lever.sum() * np.eye(3) - (kept[:, None] * r).T @ r
        rest = moment - np.cross(center, total)
        # A single point, or points in a line, bear no moment about themselves.
        b = np.linalg.pinv(inertia, rcond=1e-6, hermitian=True) @ rest
        spread = kept[:, None] * (total / whole + np.cross(b, r))
        pulling = spread @ normal < 0.0
        if not pulling.any():
            return np.asarray(spread)
        kept = np.where(pulling, 0.0, kept)
        if not kept.any():
            return force
    return force
