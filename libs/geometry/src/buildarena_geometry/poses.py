"""Rigid poses in three dimensions.

Poses are plain floats, not arrays: a machine's actions compose a handful of them each, and
at three numbers a time Python's own arithmetic is faster than an array's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from buildarena_geometry.rotations import (
    NO_ROTATION,
    ORIGIN,
    SHORTEST_QUATERNION,
    Quaternion,
    Vector,
    about_axis,
    add,
    multiply,
    normalized,
    positive,
    rotate,
    rotation_rows,
    subtract,
)

_EAST, _NORTH, _UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, init=False)
class Pose:
    """Position and orientation of a part.

    Conventions, here and everywhere in the library: right-handed frames; lengths in units (the edge
    of a small block); quaternions (w, x, y, z) of unit length whose first component that is not
    zero is positive. A pose named `world_from_part` takes coordinates in the part's frame to
    coordinates in the world frame, so neighbouring names cancel: `world_from_part @ part_from_face`
    is `world_from_face`. The world frame is x east, y north, z up.

    Attributes:
        xyz: the origin of the inner frame in the outer one, units.
        wxyz: the rotation, a unit quaternion.
    """

    xyz: Vector
    wxyz: Quaternion

    def __init__(
        self, *, position: Iterable[float] = ORIGIN, quaternion: Iterable[float] = NO_ROTATION
    ) -> None:
        """Copy and normalise the position and quaternion.

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
        return read_only(self.xyz)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3) read-only, the rotation matrix: the inner axes, outer frame, as columns."""
        return read_only(rotation_rows(self.wxyz))

    def __matmul__(self, inner: Pose) -> Pose:
        """Chain two poses: `a_from_b @ b_from_c` is `a_from_c`."""
        x, y, z = rotate(self.wxyz, inner.xyz)
        a, b, c = self.xyz
        return _pose((a + x, b + y, c + z), normalized(multiply(self.wxyz, inner.wxyz)))

    def inverse(self) -> Pose:
        """Return the inverse: `world_from_part.inverse()` is `part_from_world`."""
        w, x, y, z = self.wxyz
        back = (w, -x, -y, -z)
        a, b, c = rotate(back, self.xyz)
        return _pose((-a, -b, -c), positive(back))

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Convert points from the inner frame to the outer one.

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
        """Convert one point from the inner frame to the outer one, as plain floats."""
        x, y, z = rotate(self.wxyz, inner)
        a, b, c = self.xyz
        return (a + x, b + y, c + z)

    def direction(self, inner: Vector) -> Vector:
        """Convert a direction from the inner frame to the outer one, as plain floats."""
        return rotate(self.wxyz, inner)

    def turned(self, rotation: Quaternion) -> Pose:
        """Return the pose at the same position, turned by a rotation of the outer frame."""
        return _pose(self.xyz, normalized(multiply(rotation, self.wxyz)))

    def shifted(self, offset: Vector) -> Pose:
        """Return the pose of the same orientation, moved by an offset in the outer frame, units."""
        return _pose(add(self.xyz, offset), self.wxyz)


def turned(yaw_pitch_roll_deg: Vector) -> Quaternion:
    """Return the rotation of a whole machine.

    Args:
        yaw_pitch_roll_deg: degrees; yaw turns north to east, pitch north down, roll up to east.
            Roll acts first, then yaw, then pitch, each about the world's axes.

    Returns:
        The rotation in the world frame, a unit quaternion.
    """
    yaw, pitch, roll = yaw_pitch_roll_deg
    first = multiply(about_axis(_UP, -yaw), about_axis(_NORTH, roll))
    return multiply(about_axis(_EAST, -pitch), first)


def turn_about(center: Vector, rotation: Quaternion) -> Pose:
    """Return the rigid motion that turns the world about a point."""
    turn = Pose(quaternion=rotation)
    return Pose(position=subtract(center, turn.point(center)), quaternion=rotation)


def _pose(xyz: Vector, wxyz: Quaternion) -> Pose:
    """Create a pose of valid parts; the constructor's checks cost more than the arithmetic."""
    pose = object.__new__(Pose)
    object.__setattr__(pose, "xyz", xyz)
    object.__setattr__(pose, "wxyz", wxyz)
    return pose


def read_only(values: ArrayLike) -> NDArray[np.float64]:
    """Return the values as an immutable array."""
    array = np.array(values, np.float64)
    array.flags.writeable = False
    return array
