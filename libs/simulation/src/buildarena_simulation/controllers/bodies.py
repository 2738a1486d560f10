"""Positions and motion of blocks at a tick.

Plain numbers are faster than arrays for a few small vectors.
"""

import math
from collections.abc import Sequence

from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.structure.motion import Motion

Vector = Sequence[float]
Matrix = Sequence[Vector]


class Bodies:
    """A machine's blocks at the tick of the last call of `see`; world frame."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._shown: list[Vector] = structure.shown.tolist()
        self._axes: list[Vector] = structure.joints.axes.tolist()
        self._points: list[Vector] = structure.joints.points.tolist()
        self._clusters: Clusters | None = None

    def see(self, clusters: Clusters, motion: Motion) -> None:
        """Set the present clusters and motion."""
        if clusters is not self._clusters:
            self._clusters = clusters
            self._cluster_of: list[int] = clusters.cluster_of.tolist()
            self._centers: list[Vector] = clusters.center_of_mass.tolist()
            self._sides = _sides(clusters)
        self._position: list[Vector] = motion.position.tolist()
        self._rotation: list[Matrix] = motion.rotation.tolist()
        self._velocity: list[Vector] = motion.velocity.tolist()
        self._spin: list[Vector] = motion.spin.tolist()

    def pose(self, block: int) -> list[float]:
        """Return position, velocity, up, north as built, spin, and block-frame spin, (18,)."""
        c = self._cluster_of[block]
        (a, b, u), (d, e, v), (g, h, w) = self._rotation[c]
        x, y, z = self._spin[c]
        point = self._shown[block]
        place, speed = self._point(c, point)
        inside = (a * x + d * y + g * z, b * x + e * y + h * z, u * x + v * y + w * z)
        return [*place, *speed, u, v, w, b, e, h, x, y, z, *inside]

    def turning(self, block: int) -> float:
        """Return a block's rate of turn on its base about its axis, rad/s; 0 once it came off."""
        sides = self._sides.get(block)
        if sides is None:
            return 0.0
        own, base = sides
        axis = _turned(self._rotation[base], self._axes[block])
        return _dot(axis, _apart(self._spin[own], self._spin[base]))

    def turn(self, block: int) -> float:
        """Return a block's angle on its base about its axis, rad; 0 once it came off."""
        sides = self._sides.get(block)
        if sides is None:
            return 0.0
        own, base = (list(zip(*self._rotation[c], strict=True)) for c in sides)
        # Row i, column j: the base's axis i along the block's axis j.
        (a, b, c), (d, e, f), (g, h, i) = ([_dot(of, to) for to in own] for of in base)
        lever = (h - f, c - g, d - b)
        return math.atan2(_dot(lever, self._axes[block]), a + e + i - 1.0)

    def shift(self, block: int) -> tuple[float, float]:
        """Return a block's shift along its axis, units, and its rate; 0 once it came off."""
        sides = self._sides.get(block)
        if sides is None:
            return 0.0, 0.0
        base = sides[1]
        (own, fast), (inner, drawn) = (self._point(c, self._points[block]) for c in sides)
        offset = _apart(own, inner)
        along = _turned(self._rotation[base], self._axes[block])
        swept = _cross(self._spin[base], offset)
        return _dot(along, offset), _dot(along, _apart(_apart(fast, drawn), swept))

    def _point(self, c: int, point: Vector) -> tuple[Vector, Vector]:
        """Return position and velocity of a cluster's point that is given in the machine frame."""
        rotation = self._rotation[c]
        (px, py, pz), (vx, vy, vz) = self._position[c], self._velocity[c]
        rx, ry, rz = _turned(rotation, point)
        sx, sy, sz = _cross(self._spin[c], _turned(rotation, _apart(point, self._centers[c])))
        return (px + rx, py + ry, pz + rz), (vx + sx, vy + sy, vz + sz)


def _sides(clusters: Clusters) -> dict[int, tuple[int, int]]:
    """Return the clusters of each moving block and of its base, without blocks that came off."""
    rows = zip(
        clusters.attached.tolist(),
        clusters.parent.tolist(),
        clusters.attached_is_outer.tolist(),
        strict=True,
    )
    return {
        block: (cluster, parent) if outer else (parent, cluster)
        for cluster, (block, parent, outer) in enumerate(rows)
        if parent >= 0
    }


def _turned(rotation: Matrix, vector: Vector) -> tuple[float, float, float]:
    (a, b, c), (d, e, f), (g, h, i) = rotation
    x, y, z = vector
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def _cross(a: Vector, b: Vector) -> tuple[float, float, float]:
    (ax, ay, az), (bx, by, bz) = a, b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _apart(a: Vector, b: Vector) -> tuple[float, float, float]:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
