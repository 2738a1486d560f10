"""Contact forces, shared evenly over the points of each contact patch.

How the force between two rigid bodies is spread over many contact points is not determined by
statics: a solver may put it all on one corner and still be right. Joint loads depend on it, so each
patch keeps its resultant and gets the spread of least squares, the one an even elastic layer
between the bodies would give.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray
from buildarena_simulation.structure.vectors import columns_of, cross, summed_at

WORLD: Final = -1
"""Ground and terrain on the other side of a contact: one body."""

CARGO: Final = -2
"""The cargo on the other side of a contact."""

_NORMAL_GRID: Final = 4.0
"""Grid on which normals are equal: their components round to the same quarters."""

_NORMAL_DIGITS: Final = np.array([256, 16, 1])
_ROUNDS: Final = 4
_UNIT: Final = np.eye(3)
_LINE_TOLERANCE: Final = 1e-6
"""Share of the spread that keeps the system solvable for points in a line, which take no moment."""

_POINT_TOLERANCE: Final = 1e-9
"""The same for a single point, units²."""


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
        other: (K,) the body on the other side: a cluster's number, `WORLD` or `CARGO`.
        surface: (K,) which fixed body it is: 0 for the ground, from 1 on the terrain's boxes; -1
            for a body that moves.
        weight: (K,) share of the point that belongs to the block, above 0, at most 1.
        area: (K,) over which it presses, units²; 0 for a single point.
        normal: (K, 3) unit vector from the other body to the block, world frame.
        point: (K, 3) world frame, units.
        force: (K, 3) on the block, normal and friction, world frame, mass·unit/s².
    """

    block: IntArray
    other: IntArray
    surface: IntArray
    weight: FloatArray
    area: FloatArray
    normal: FloatArray
    point: FloatArray
    force: FloatArray


def together(parts: Sequence[PointForces]) -> PointForces:
    """Concatenate several sets of forces, in order."""
    return PointForces(
        block=np.concatenate([part.block for part in parts]),
        point=np.concatenate([part.point for part in parts]),
        force=np.concatenate([part.force for part in parts]),
    )


def joined(parts: Sequence[ContactForces]) -> ContactForces:
    """Concatenate several contacts in one table, in order."""
    if len(parts) == 1:
        return parts[0]
    columns = (np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(ContactForces))
    return ContactForces(**dict(zip((f.name for f in fields(ContactForces)), columns, strict=True)))


def mean_contacts(readings: Sequence[tuple[float, ContactForces]]) -> ContactForces:
    """Return the mean of several readings.

    Args:
        readings: Readings, each with its share of the time.
    """
    if len(readings) == 1 and readings[0][0] == 1.0:
        return readings[0][1]
    return joined(
        [
            replace(reading, weight=share * reading.weight, force=share * reading.force)
            for share, reading in readings
        ]
    )


class EvenSharing:
    """Spreads each patch's force evenly over its points.

    A patch is all contacts between one cluster and one other body with about the same normal. Its
    forces become w·(a + cross(b, r)), with a and b such that force and moment stay as they were;
    points that would have to pull are left out and the rest is spread again. What touches what
    changes seldom, so the last patches are remembered.

    Args:
        cluster_of: (N,) cluster of each block.
    """

    def __init__(self, cluster_of: IntArray) -> None:
        self._cluster_of = cluster_of
        self._known: tuple[bytes, bytes] = (b"", b"")
        self._patches = _NO_PATCHES

    def shared(self, contacts: ContactForces) -> PointForces:
        """Return the contacts with their forces spread."""
        force = contacts.force
        if len(contacts.block) > 1:
            force = _spread(contacts, self._patches_of(contacts))
        return PointForces(block=contacts.block, point=contacts.point, force=force)

    def _patches_of(self, contacts: ContactForces) -> "_Patches":
        key = _patch_keys(contacts, self._cluster_of)
        cache_key = key.tobytes(), contacts.block.tobytes()
        if cache_key != self._known:
            self._known = cache_key
            self._patches = _find_patches(key, contacts.block)
        return self._patches


@dataclass(frozen=True, slots=True, kw_only=True)
class _Patches:
    """Partition of contacts into patches.

    Attributes:
        of: (K,) patch of each contact.
        count: Number of patches.
        of_block: (K,) index of contact's block and patch together.
        columns: (19 K,) target indices of the sums over each patch, flat.
        vectors: (3 K,) target indices of sums of vectors.
    """

    of: IntArray
    count: int
    of_block: IntArray
    columns: IntArray
    vectors: IntArray


_SUMS: Final = 19
_NO_PATCHES: Final = _Patches(
    of=np.zeros(0, dtype=np.int64),
    count=0,
    of_block=np.zeros(0, dtype=np.int64),
    columns=np.zeros(0, dtype=np.int64),
    vectors=np.zeros(0, dtype=np.int64),
)


def _patch_keys(contacts: ContactForces, cluster_of: IntArray) -> IntArray:
    """Return a number for each contact that is equal within a patch."""
    way = (contacts.normal * _NORMAL_GRID + 8.5).astype(np.int64) @ _NORMAL_DIGITS
    key = (cluster_of.take(contacts.block) * 2**22 + contacts.other + 2**20) * 2**12 + way
    return np.asarray(key, dtype=np.int64)


def _find_patches(key: IntArray, block: IntArray) -> _Patches:
    _, of = np.unique(key, return_inverse=True)
    _, of_block = np.unique(of * (int(block.max()) + 1) + block, return_inverse=True)
    return _Patches(
        of=of,
        count=int(of.max()) + 1,
        of_block=of_block,
        columns=columns_of(of, _SUMS),
        vectors=columns_of(of, 3),
    )


def _spread(contacts: ContactForces, patches: _Patches) -> FloatArray:
    of, count = patches.of, patches.count
    anchor = np.empty((count, 3))
    anchor[of] = contacts.point
    x = contacts.point - anchor.take(of, 0)
    # Points share a patch by blocks: how many points a block has is the solver's choice.
    of_block = np.bincount(patches.of_block, contacts.weight).take(patches.of_block)
    weight = contacts.weight / np.maximum(of_block, 1e-12)
    weight = np.where(contacts.area > 0.0, contacts.area, weight)
    normal = summed_at(patches.vectors, contacts.normal, count).take(of, 0)
    rows = np.empty((len(x), _SUMS))
    rows[:, 13:16] = contacts.force
    rows[:, 16:19] = cross(x, contacts.force)
    for _ in range(_ROUNDS):
        spread = _even(rows, x, weight, patches)
        pulling = np.add.reduce(spread * normal, axis=1) < 0.0
        if not pulling.any():
            return spread
        pushing = np.where(pulling, 0.0, weight)
        total = np.bincount(of, pushing, minlength=count)
        # A patch that would lose all its points stays as it was.
        weight = np.where(total.take(of) > 0.0, pushing, weight)
    return spread


def _even(rows: FloatArray, x: FloatArray, weight: FloatArray, patches: _Patches) -> FloatArray:
    """Return forces w·(a + cross(b, r)), (K, 3).

    Args:
        rows: (K, 19) values to sum over each patch; forces and moments are at 13 and above, and the
            others are written.
        x: (K, 3) points from an anchor of their patch, units.
        weight: (K,) of each point.
    """
    of, heavy = patches.of, weight[:, None] * x
    rows[:, 0], rows[:, 1:4] = weight, heavy
    rows[:, 4:13] = (heavy[:, :, None] * x[:, None, :]).reshape(-1, 9)
    sums = summed_at(patches.columns, rows, patches.count)
    weights, total, moment = sums[:, :1], sums[:, 13:16], sums[:, 16:19]
    center = sums[:, 1:4] / weights
    second = sums[:, 4:13].reshape(-1, 3, 3)
    second = second - weights[:, :, None] * center[:, :, None] * center[:, None, :]
    trace = (second[:, 0, 0] + second[:, 1, 1] + second[:, 2, 2])[:, None, None]
    inertia = ((1.0 + _LINE_TOLERANCE) * trace + _POINT_TOLERANCE) * _UNIT - second
    remainder = (moment - cross(center, total))[:, :, None]
    b = np.asarray(np.linalg.solve(inertia, remainder)[:, :, 0], dtype=np.float64)
    turning = cross(b.take(of, 0), x - center.take(of, 0))
    return np.asarray(weight[:, None] * ((total / weights).take(of, 0) + turning))
