"""Contact forces, shared evenly over the points of each contact patch.

How the force between two rigid bodies is spread over many contact points is not determined by
statics: a solver may put it all on one corner and still be right. Joint loads depend on it, so each
patch keeps its resultant and gets the spread of least squares, the one an even elastic layer
between the bodies would give.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray
from buildarena_simulation.structure.vectors import cross, summed_by

_NORMAL_GRID: Final = 4.0
"""Normals are told apart by their components rounded to quarters."""

_ROUNDS: Final = 4
_LINE_TOLERANCE: Final = 1e-6
"""Points in a line bear no moment about it; this share of the spread keeps that solvable."""


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
        other: (K,) any number that tells the body on the other side; ground and terrain are one.
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


def mean_contacts(readings: Sequence[tuple[float, ContactForces]]) -> ContactForces:
    """The mean of several readings.

    Args:
        readings: Share of the time each stands for, and the reading.
    """
    if len(readings) == 1:
        return readings[0][1]
    return ContactForces(
        block=np.concatenate([reading.block for _, reading in readings]),
        other=np.concatenate([reading.other for _, reading in readings]),
        weight=np.concatenate([share * reading.weight for share, reading in readings]),
        normal=np.concatenate([reading.normal for _, reading in readings]),
        point=np.concatenate([reading.point for _, reading in readings]),
        force=np.concatenate([share * reading.force for share, reading in readings]),
    )


def evenly_shared(contacts: ContactForces, cluster_of: IntArray) -> PointForces:
    """The contacts with each patch's force spread evenly.

    A patch is all contacts between one cluster and one other body with about the same normal. Its
    forces become w·(a + cross(b, r)), with a and b such that force and moment stay as they were;
    points that would have to pull are left out and the rest is spread again.

    Args:
        contacts: As reported.
        cluster_of: (N,) cluster of each block.
    """
    block, point, force = contacts.block, contacts.point, contacts.force
    if len(block) > 1:
        patch, count = _patches(contacts, cluster_of)
        force = _spread(contacts, patch, count)
    return PointForces(block=block, point=point, force=force)


def _patches(contacts: ContactForces, cluster_of: IntArray) -> tuple[IntArray, int]:
    """Patch of each contact, and how many there are."""
    way = np.round(contacts.normal * _NORMAL_GRID).astype(np.int64) + 8
    key = cluster_of[contacts.block]
    for digit, base in ((contacts.other + 2**20, 2**22), *((way[:, k], 16) for k in range(3))):
        key = key * base + digit
    _, patch = np.unique(key, return_inverse=True)
    return patch, int(patch.max()) + 1


def _spread(contacts: ContactForces, patch: IntArray, count: int) -> FloatArray:
    anchor = np.empty((count, 3))
    anchor[patch] = contacts.point
    x = contacts.point - anchor[patch]
    normal = summed_by(patch, contacts.normal, count)
    load = summed_by(
        patch, np.concatenate([contacts.force, cross(x, contacts.force)], axis=1), count
    )
    total, moment = load[:, :3], load[:, 3:]
    weight = contacts.weight / _points_beside(contacts, patch)
    for _ in range(_ROUNDS):
        spread = _even(x, weight, patch, total, moment)
        pulling = (spread * normal[patch]).sum(axis=1) < 0.0
        if not pulling.any():
            return spread
        kept = np.where(pulling, 0.0, weight)
        whole = np.bincount(patch, kept, minlength=count)
        # A patch that would lose all its points stays as it was.
        weight = np.where(whole[patch] > 0.0, kept, weight)
    return spread


def _points_beside(contacts: ContactForces, patch: IntArray) -> FloatArray:
    """Number of points its block has in its patch, for each contact.

    A patch is shared by its blocks alike: how many points a block has is the solver's choice.
    """
    key = patch * (int(contacts.block.max()) + 1) + contacts.block
    _, which = np.unique(key, return_inverse=True)
    return np.asarray(np.bincount(which, contacts.weight)[which], dtype=np.float64)


def _even(
    x: FloatArray, weight: FloatArray, patch: IntArray, total: FloatArray, moment: FloatArray
) -> FloatArray:
    """Forces w·(a + cross(b, r)) of given resultants.

    Args:
        x: (K, 3) points from an anchor of their patch, units.
        weight: (K,) of each point.
        patch: (K,) patch of each point.
        total: (P, 3) resultant force of each patch.
        moment: (P, 3) resultant moment of each patch about its anchor.
    """
    count = len(total)
    sums = summed_by(patch, np.column_stack([weight, weight[:, None] * x]), count)
    whole = sums[:, :1]
    center = sums[:, 1:] / whole
    r = x - center[patch]
    second = summed_by(
        patch, (weight[:, None, None] * r[:, :, None] * r[:, None, :]).reshape(-1, 9), count
    ).reshape(-1, 3, 3)
    trace = np.trace(second, axis1=1, axis2=2)[:, None, None]
    inertia = (1.0 + _LINE_TOLERANCE) * trace * np.eye(3) - second + 1e-12 * np.eye(3)
    rest = moment - cross(center, total)
    b = np.linalg.solve(inertia, rest[:, :, None])[:, :, 0]
    return np.asarray(weight[:, None] * ((total / whole)[patch] + cross(b[patch], r)))
