"""The solids that modules are made of."""

import math

from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import ORIGIN, Vector, add, from_axes, scaled, subtract
from buildarena_geometry.struct_reader import Form, Point, Positive, refuse

_CORNERS = {"lowest": "from", "highest": "to"}
_ENDS = {"base": "from", "top": "to"}  # names of the fields in module files


class _Shape(Form, frozen=True, kw_only=True, tag_field="shape"):
    """A solid, which module files name by its shape."""


class Box(_Shape, frozen=True, kw_only=True, tag="box", rename=_CORNERS):
    """A box with its edges along the block's axes.

    Attributes:
        lowest: (3,) its corner with the smallest coordinates, block frame, units.
        highest: (3,) the corner opposite.
    """

    lowest: Point
    highest: Point

    def __post_init__(self) -> None:
        """Refuse a box without a volume."""
        if not all(low < high for low, high in zip(self.lowest, self.highest, strict=True)):
            refuse("to", f"three numbers, each larger than in {list(self.lowest)}", self.highest)

    @property
    def center(self) -> Vector:
        """(3,) its middle, block frame, units."""
        return scaled(add(self.lowest, self.highest), 0.5)

    @property
    def size(self) -> Vector:
        """(3,) its edges along x, y and z, units."""
        return subtract(self.highest, self.lowest)


class Cylinder(_Shape, frozen=True, kw_only=True, tag="cylinder", rename=_ENDS):
    """A right circular cylinder.

    Attributes:
        radius: units.
        base: (3,) centre of the one end, block frame, units.
        top: (3,) centre of the other.
    """

    radius: Positive
    base: Point
    top: Point

    def __post_init__(self) -> None:
        """Refuse a cylinder without a length."""
        if self.base == self.top:
            refuse("to", "another point than `from`", self.top)

    @property
    def length(self) -> float:
        """Distance between its ends, units."""
        return math.dist(self.base, self.top)

    @property
    def center(self) -> Vector:
        """(3,) its middle, block frame, units."""
        return scaled(add(self.base, self.top), 0.5)

    @property
    def block_from_axis(self) -> Pose:
        """The frame of its middle in the block's, +z along its axis."""
        x, y, z = scaled(subtract(self.top, self.base), 1 / self.length)
        # Any x axis will do: a cylinder looks the same all round.
        across = (0.0, -z, y) if abs(x) < max(abs(y), abs(z)) else (-y, x, 0.0)
        norm = math.dist(across, ORIGIN)
        x_axis = (across[0] / norm, across[1] / norm, across[2] / norm)
        turn = from_axes(x_axis, (x, y, z))
        return Pose(position=self.center, quaternion=turn)


class Ball(_Shape, frozen=True, kw_only=True, tag="sphere"):
    """A solid sphere.

    Attributes:
        radius: units.
        center: (3,) its middle, block frame, units.
    """

    radius: Positive
    center: Point

    @property
    def size(self) -> Vector:
        """(3,) its extent along x, y and z, units."""
        across = 2.0 * self.radius
        return (across, across, across)


Solid = Box | Cylinder | Ball
