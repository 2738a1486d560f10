"""Rigid poses in three dimensions.

Poses are kept as plain floats, not arrays: a machine's actions compose a handful of them each, and at
three numbers a time Python's own arithmetic is faster than an array's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)
NO_ROTATION: Quaternion = (1.0, 0.0, 0.0, 0.0)
SHORTEST_QUATERNION = 1e-9  # a shorter one carries no direction that could be trusted
SIGN_TOLERANCE = 1e-12  # a component below it is rounding, and decides no sign


@dataclass(frozen=True, slots=True, init=False)
class Pose:
    """Where a part is and how it is turned.

    Conventions, here and everywhere in the library: right-handed frames; lengths in units (the edge
    of a small block); quaternions (w, x, y, z) of unit length whose first component that is not zero
    is positive. A pose named `world_from_part` takes coordinates in the part's frame to coordinates
    in the world frame, so neighbouring names cancel: `world_from_part @ part_from_face` is
    `world_from_face`. The world frame is x east, y north, z up.

    Attributes:
        xyz: the origin of the inner frame in the outer one, units.
        wxyz: the rotation, a unit quaternion.
    """

    xyz: Vector
    wxyz: Quaternion

    def __init__(
        self, *, position: Iterable[float] = ORIGIN, quaternion: Iterable[float] = NO_ROTATION
    ) -> None:
        """Copies and normalises what it is given.

        Args:
            position: (3,) finite, the origin of the inner frame in the outer one, units.
            quaternion: (4,) finite, (w, x, y, z), of any length but zero.

        Raises:
            ValueError: a wrong number of components, one that is not finite, or a zero quaternion.
        """
        point = tuple(float(value) for value in position)
        turn = tuple(float(value) for value in quaternion)
        if len(point) != len(ORIGIN) or not all(map(math.isfinite, point)):
            raise ValueError(f"a position is three finite numbers, not {point}")
        if len(turn) != len(NO_ROTATION) or not all(map(math.isfinite, turn)):
            raise ValueError(f"a quaternion is four finite numbers (w, x, y, z), not {turn}")
        if math.hypot(*turn) < SHORTEST_QUATERNION:
            raise ValueError(f"a quaternion has a length, not {turn}")
        object.__setattr__(self, "xyz", point)
        object.__setattr__(self, "wxyz", normalized(turn))

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) read-only, the origin of the inner frame in the outer one, units."""
        return _read_only(self.xyz)

    @property
    def quaternion(self) -> NDArray[np.float64]:
        """(4,) read-only, the rotation as a unit quaternion (w, x, y, z)."""
        return _read_only(self.wxyz)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3) read-only, the rotation matrix; its columns are the inner axes in the outer frame."""
        return _read_only(rotation_rows(self.wxyz))

    def __matmul__(self, inner: Pose) -> Pose:
        """Chains two poses: `a_from_b @ b_from_c` is `a_from_c`."""
        x, y, z = rotate(self.wxyz, inner.xyz)
        a, b, c = self.xyz
        return _pose((a + x, b + y, c + z), normalized(multiply(self.wxyz, inner.wxyz)))

    def inverse(self) -> Pose:
        """The pose read the other way round: `world_from_part.inverse()` is `part_from_world`."""
        w, x, y, z = self.wxyz
        back = (w, -x, -y, -z)
        a, b, c = rotate(back, self.xyz)
        return _pose((-a, -b, -c), positive(back))

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Outer coordinates of points given in the inner frame.

        Args:
            points: (3,) or (N, 3), inner frame, units.

        Returns:
            An array of the same shape, outer frame, units.
        """
        moved: NDArray[np.float64] = (
            np.asarray(points, np.float64) @ self.rotation.T + self.position
        )
        return moved

    def point(self, inner: Vector) -> Vector:
        """Outer coordinates of one point given in the inner frame, as plain floats."""
        x, y, z = rotate(self.wxyz, inner)
        a, b, c = self.xyz
        return (a + x, b + y, c + z)

    def direction(self, inner: Vector) -> Vector:
        """A direction given in the inner frame, seen from the outer one, as plain floats."""
        return rotate(self.wxyz, inner)

    def turned(self, rotation: Quaternion) -> Pose:
        """The same place, turned about it by a rotation of the outer frame."""
        return _pose(self.xyz, normalized(multiply(rotation, self.wxyz)))

    def shifted(self, offset: Vector) -> Pose:
        """The same orientation, moved by an offset in the outer frame, units."""
        return _pose(add(self.xyz, offset), self.wxyz)


def multiply(left: Quaternion, right: Quaternion) -> Quaternion:
    """The Hamilton product: the rotation `right` followed by the rotation `left`."""
    a, b, c, d = left
    w, x, y, z = right
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def rotate(quaternion: Quaternion, vector: Vector) -> Vector:
    """The vector turned by the rotation a unit quaternion stands for."""
    w, x, y, z = quaternion
    a, b, c = vector
    # v + 2w (q × v) + 2 q × (q × v), with t = 2 q × v
    t, u, v = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (
        a + w * t + y * v - z * u,
        b + w * u + z * t - x * v,
        c + w * v + x * u - y * t,
    )


def about_axis(axis: Vector, angle_deg: float) -> Quaternion:
    """The right-handed rotation about an axis.

    Args:
        axis: unit length.
        angle_deg: degrees, counter-clockwise seen from the axis's tip.

    Returns:
        A unit quaternion; multiples of 360° give exactly no rotation.
    """
    half = math.radians(math.remainder(angle_deg, 360.0)) / 2
    sine = math.sin(half)
    return positive((math.cos(half), axis[0] * sine, axis[1] * sine, axis[2] * sine))


def from_axes(x_axis: Vector, z_axis: Vector) -> Quaternion:
    """The rotation of a frame whose x and z axes are given in the outer frame.

    Args:
        x_axis: unit length, perpendicular to z_axis.
        z_axis: unit length.

    Returns:
        A unit quaternion.
    """
    y_axis = cross(z_axis, x_axis)
    (a, d, g), (b, e, h), (c, f, i) = x_axis, y_axis, z_axis  # columns of the rotation matrix
    # The largest of the four squared components is taken first: its square root divides the others.
    squares = (1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i)
    largest = max(range(4), key=squares.__getitem__)
    rows = (
        (squares[0], h - f, c - g, d - b),
        (h - f, squares[1], d + b, c + g),
        (c - g, d + b, squares[2], h + f),
        (d - b, c + g, h + f, squares[3]),
    )
    return normalized(rows[largest])


def rotation_rows(quaternion: Quaternion) -> tuple[Vector, Vector, Vector]:
    """The rotation matrix of a unit quaternion, row by row."""
    w, x, y, z = quaternion
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def normalized(quaternion: tuple[float, ...]) -> Quaternion:
    """The quaternion of unit length, with its first component that is not zero positive.

    One that is of unit length up to rounding keeps its bits, so that a pose read back from a document
    is the very pose that was written.
    """
    w, x, y, z = quaternion
    squared = w * w + x * x + y * y + z * z
    if abs(squared - 1) > 1e-15:  # noqa: PLR2004  a few times the rounding of the sum above
        scale = 1 / math.sqrt(squared)
        w, x, y, z = w * scale, x * scale, y * scale, z * scale
    return positive((w, x, y, z))


def positive(quaternion: Quaternion) -> Quaternion:
    """Of the two quaternions of a rotation, the one whose first component that is not zero is positive."""
    for component in quaternion:
        if component > SIGN_TOLERANCE:
            return quaternion
        if component < -SIGN_TOLERANCE:
            w, x, y, z = quaternion
            return (-w, -x, -y, -z)
    return quaternion


def add(left: Vector, right: Vector) -> Vector:
    """The sum of two vectors."""
    return (left[0] + right[0], left[1] + right[1], left[2] + right[2])


def subtract(left: Vector, right: Vector) -> Vector:
    """The vector that leads from `right` to `left`."""
    return (left[0] - right[0], left[1] - right[1], left[2] - right[2])


def scaled(vector: Vector, factor: float) -> Vector:
    """The vector times a number."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def dot(left: Vector, right: Vector) -> float:
    """The scalar product."""
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


def cross(left: Vector, right: Vector) -> Vector:
    """The vector product, right-handed."""
    a, b, c = left
    x, y, z = right
    return (b * z - c * y, c * x - a * z, a * y - b * x)


def distance(left: Vector, right: Vector) -> float:
    """How far two points are apart, units."""
    return math.dist(left, right)


IDENTITY = Pose()


def _pose(xyz: Vector, wxyz: Quaternion) -> Pose:
    """A pose of parts that are known to be good: the constructor's checks would cost more than the sum."""
    pose = object.__new__(Pose)
    object.__setattr__(pose, "xyz", xyz)
    object.__setattr__(pose, "wxyz", wxyz)
    return pose


def _read_only(values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, np.float64)
    array.flags.writeable = False
    return array
