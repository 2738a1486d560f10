"""Terrain as task files write it: pipes, cylinders, cones, bends, heights, which become boxes.

What a scenario holds, what engines collide with and what films and pages draw are the boxes.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

_DIGITS: Final = 6
"""Decimals of a box's figures, which makes them equal on all processors."""

_UPRIGHT: Final = 90.0
_THINNEST: Final = 0.1
"""Minimum thickness of a box of a scenario, units."""

Place = Annotated[float, Field(allow_inf_nan=False, ge=-1e4, le=1e4)]
Extent = Annotated[float, Field(ge=0.1, le=1000)]
Height = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1000)]
Angle = Annotated[float, Field(allow_inf_nan=False, ge=-180, le=180)]


class _Round(BaseModel):
    """Common fields of pipes and cylinders, which lie along their axis.

    Attributes:
        center: (3,) middle of the axis, world frame, units.
        radius: Radius in units: a pipe's inner one, a cylinder's outer one. The boxes touch
            it in their middles.
        length: Along the axis, units.
        heading_deg: Rotation about the vertical, from north towards east, degrees. At 0 the axis
            runs from west to east; at 90 a whole pipe is a ring that is seen from the south.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    center: tuple[Place, Place, Place]
    radius: Extent
    length: Extent
    heading_deg: Angle = 0.0

    def _box(self, angle: float, distance: float, width: float, height: float) -> dict[str, Any]:
        """Return a box whose height points away from the axis.

        Args:
            angle: Its direction, from straight down towards the front, degrees.
            distance: Distance of its centre from the axis, units.
            width: Size across, units.
            height: Size away from the axis, units.
        """
        turn, heading = math.radians(angle), math.radians(self.heading_deg)
        ahead, down = distance * math.sin(turn), distance * math.cos(turn)
        x, y, z = self.center
        slope = (angle + _UPRIGHT) % (2 * _UPRIGHT) - _UPRIGHT  # a box looks the same upside down
        if math.isclose(abs(slope), _UPRIGHT):
            slope, width, height = 0.0, height, width
        center = (x + ahead * math.sin(heading), y + ahead * math.cos(heading), z - down)
        return {
            "center": [round(value, _DIGITS) + 0.0 for value in center],
            "size": [round(value, _DIGITS) for value in (self.length, width, height)],
            "slope_deg": round(slope, _DIGITS) + 0.0,
            "heading_deg": self.heading_deg,
        }


class Pipe(_Round):
    """A pipe, or a part of one: quarter pipes, half pipes, arches and rings.

    Attributes:
        from_deg: Its beginning, from straight down towards the front, degrees: a quarter pipe that
            rises to the north reaches from 0 to 90, a half pipe from -90 to 90.
        to_deg: Its end.
        thickness: Thickness of its wall, which lies outside the radius, units.
        segments: Number of boxes.
    """

    shape: Literal["pipe"]
    from_deg: Angle = -180.0
    to_deg: Angle = 180.0
    thickness: Annotated[float, Field(ge=0.1, le=100)] = 0.5
    segments: Annotated[int, Field(ge=1, le=64)] = 12

    @model_validator(mode="after")
    def _is_an_arc(self) -> Self:
        if self.arc <= 0:
            raise ValueError(f"to_deg {self.to_deg:g} is not beyond from_deg {self.from_deg:g}")
        if self.arc / self.segments > _UPRIGHT:
            raise ValueError(f"{self.segments} segments are too few for {self.arc:g} degrees")
        return self

    @property
    def arc(self) -> float:
        """Angle from its beginning to its end, degrees."""
        return self.to_deg - self.from_deg

    def boxes(self) -> Iterator[dict[str, Any]]:
        """Yield its segments as boxes, in a scenario's format."""
        each = self.arc / self.segments
        outer = self.radius + self.thickness
        width = 2 * outer * math.tan(math.radians(each / 2))
        for number in range(self.segments):
            angle = self.from_deg + (number + 0.5) * each
            yield self._box(angle, self.radius + self.thickness / 2, width, self.thickness)


class Cylinder(_Round):
    """A horizontal solid cylinder; half in the ground it is a hump.

    Attributes:
        sides: Number of sides of its surface; even.
    """

    shape: Literal["cylinder"]
    sides: Annotated[int, Field(ge=4, le=64, multiple_of=2)] = 16

    def boxes(self) -> Iterator[dict[str, Any]]:
        """Yield one box for every two opposite sides, in a scenario's format."""
        width = 2 * self.radius * math.tan(math.pi / self.sides)
        for number in range(self.sides // 2):
            yield self._box(number * 360.0 / self.sides, 0.0, width, 2 * self.radius)


class _Upright(BaseModel):
    """Common fields of cones and bends, which have a vertical axis.

    Attributes:
        center: (3,) their axis at the level of their base, world frame, units.
        radius: Units.
        height: Height of the top above that level, units.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    center: tuple[Place, Place, Place]
    radius: Extent
    height: Extent

    def _box(
        self, heading: float, distance: float, size: tuple[float, float, float], low: float = 0.0
    ) -> dict[str, Any]:
        """Return a box at a distance from the axis.

        Args:
            heading: Its direction from the axis, from north towards east, degrees.
            distance: Distance of its middle from the axis, units.
            size: (3,) across, away from the axis and up, units.
            low: Height of its underside above the level, units.
        """
        turn, (x, y, z) = math.radians(heading), self.center
        center = (
            x + distance * math.sin(turn),
            y + distance * math.cos(turn),
            z + low + size[2] / 2,
        )
        return {
            "center": [round(value, _DIGITS) + 0.0 for value in center],
            "size": [round(value, _DIGITS) for value in size],
            "heading_deg": round((heading + 180) % 360 - 180, _DIGITS) + 0.0,
        }


class Cone(_Upright):
    """A cone on its base, in steps.

    Attributes:
        layers: Number of steps.
        sides: Number of sides of each; even.
    """

    shape: Literal["cone"]
    layers: Annotated[int, Field(ge=1, le=16)] = 6
    sides: Annotated[int, Field(ge=4, le=64, multiple_of=2)] = 8

    def boxes(self) -> Iterator[dict[str, Any]]:
        """Yield one box for every two opposite sides of each step, in a scenario's format."""
        rise = self.height / self.layers
        for layer in range(self.layers):
            radius = self.radius * (1 - (layer + 0.5) / self.layers)
            across = 2 * radius * math.tan(math.pi / self.sides)
            size = (max(across, _THINNEST), max(2 * radius, _THINNEST), rise)
            for number in range(self.sides // 2):
                yield self._box(number * 360.0 / self.sides, 0.0, size, layer * rise)


class Bend(_Upright):
    """A wall along an arc: the side of a road that bends.

    The radius is that of its side towards the axis, which its boxes touch in their middles.

    Attributes:
        from_deg: Its beginning, seen from the axis, from north towards east, degrees.
        to_deg: Its end.
        thickness: Away from the axis, units.
        segments: Number of boxes.
    """

    shape: Literal["bend"]
    from_deg: Annotated[float, Field(allow_inf_nan=False, ge=-360, le=360)]
    to_deg: Annotated[float, Field(allow_inf_nan=False, ge=-360, le=360)]
    thickness: Annotated[float, Field(ge=0.1, le=100)] = 0.5
    segments: Annotated[int, Field(ge=1, le=64)] = 8

    @model_validator(mode="after")
    def _is_an_arc(self) -> Self:
        arc = self.to_deg - self.from_deg
        if not 0 < arc <= 360:  # noqa: PLR2004 - a whole turn
            raise ValueError(f"from_deg {self.from_deg:g} to to_deg {self.to_deg:g} is not an arc")
        if arc / self.segments > _UPRIGHT:
            raise ValueError(f"{self.segments} segments are too few for {arc:g} degrees")
        return self

    def boxes(self) -> Iterator[dict[str, Any]]:
        """Yield its segments as boxes, in a scenario's format."""
        each, outer = (self.to_deg - self.from_deg) / self.segments, self.radius + self.thickness
        width = 2 * outer * math.tan(math.radians(each / 2))
        for number in range(self.segments):
            heading = self.from_deg + (number + 0.5) * each
            size = (width, self.thickness, self.height)
            yield self._box(heading, self.radius + self.thickness / 2, size)


class Heights(BaseModel):
    """A height field: ground of varying height, in steps.

    Attributes:
        center: (3,) its middle, at the level of its base, world frame, units.
        cell: (2,) size of a cell to the east and to the north, units.
        rows: Heights above that level, units: rows from south to north, each from west to east, all
            of equal length. A cell of height 0 is empty.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    shape: Literal["heights"]
    center: tuple[Place, Place, Place]
    cell: tuple[Extent, Extent]
    rows: Annotated[
        tuple[Annotated[tuple[Height, ...], Field(min_length=1, max_length=64)], ...],
        Field(min_length=1, max_length=64),
    ]

    @model_validator(mode="after")
    def _is_a_grid(self) -> Self:
        lengths = sorted({len(row) for row in self.rows})
        if len(lengths) > 1:
            raise ValueError(f"rows have {lengths[0]} to {lengths[-1]} heights: all need as many")
        thin = [height for row in self.rows for height in row if 0 < height < _THINNEST]
        if thin:
            raise ValueError(f"a height of {thin[0]:g} is below {_THINNEST:g}, and not 0")
        return self

    def boxes(self) -> Iterator[dict[str, Any]]:
        """Yield one box for each run of cells of the same height along a row."""
        (east, north), (x, y, z) = self.cell, self.center
        west = x - east * len(self.rows[0]) / 2
        south = y - north * len(self.rows) / 2
        for number, row in enumerate(self.rows):
            begin = 0
            for height, run in groupby(row):
                count = len(tuple(run))
                middle = west + east * (begin + count / 2)
                begin += count
                if height:
                    center = (middle, south + north * (number + 0.5), z + height / 2)
                    yield {
                        "center": [round(value, _DIGITS) + 0.0 for value in center],
                        "size": [round(value, _DIGITS) for value in (east * count, north, height)],
                    }


_Shape = Pipe | Cylinder | Cone | Bend | Heights
_SHAPES: Final[TypeAdapter[_Shape]] = TypeAdapter(Annotated[_Shape, Field(discriminator="shape")])


def with_boxes(terrain: Any) -> Any:
    """Replace the other shapes of a task file's terrain by boxes.

    Raises:
        ValueError: A shape is none; the message names its number and what is wrong.
    """
    if not isinstance(terrain, list | tuple):
        return terrain
    boxes: list[Any] = []
    for number, entry in enumerate(terrain):
        if not isinstance(entry, Mapping) or "shape" not in entry:
            boxes.append(entry)
            continue
        try:
            boxes.extend(_SHAPES.validate_python(dict(entry)).boxes())
        except ValidationError as error:
            wrong = error.errors()[0]
            place = ".".join(str(part) for part in (number, *wrong["loc"]))
            raise ValueError(f"{place}: {wrong['msg']}") from error
    return boxes
