"""Picture of a trial at one moment: flat faces and lines in the world."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_geometry.export.meshes import polygons
from buildarena_geometry.modules.solids import Ball, Box, Cylinder, Solid
from buildarena_geometry.rotations import ORIGIN
from buildarena_simulation.engines.base import rotation_of
from buildarena_simulation.machine import structure_of
from buildarena_simulation.structure.model import FloatArray, Shape, ShapeKind
from buildarena_simulation.terrain import shape_of

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation.scenario import Mark, Scenario
    from buildarena_simulation.trajectory import Trajectory

Color = tuple[int, int, int]

_COLORS: Final[dict[str, Color]] = {
    "start": (196, 78, 66),
    "block": (205, 164, 108),
    "wheel": (82, 84, 92),
    "cannon": (86, 132, 178),
    "torch": (140, 96, 60),
    "joint": (150, 112, 158),
    "flight": (222, 208, 170),
    "device": (140, 152, 164),
}
_HEATED: Final[Color] = (230, 120, 50)
_CARGO: Final[Color] = (120, 124, 132)
_TERRAIN: Final[Color] = (132, 160, 116)
_BRACE: Final[Color] = (60, 64, 72)
_WINCH: Final[Color] = (168, 140, 60)
_FLAME: Final[Color] = (250, 190, 60)
_SIGN: Final[Color] = (194, 65, 12)
_POST: Final = 2.0
"""Height of a gate's posts, units."""
_ROUND_SIDES: Final = 16
_LINE_SIDES: Final = 120
_FIRST_SIDE: Final = 2
"""Index of the first side among a cylinder's faces."""
_SPOKE: Final[Color] = (200, 200, 200)
_LIGHT: Final = np.array([0.35, -0.5, 0.79])


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """Shapes to draw, world frame.

    Attributes:
        faces: Corners (K, 3) and shaded colour of each flat face.
        lines: Ends (2, 3) and colour of each line.
        balls: Centre (3,), radius and colour of each ball.
    """

    faces: list[tuple[FloatArray, Color]] = field(default_factory=list)
    lines: list[tuple[FloatArray, Color]] = field(default_factory=list)
    balls: list[tuple[FloatArray, float, Color]] = field(default_factory=list)


class Scene:
    """Pictures of a trial.

    Args:
        trajectory: Trajectory; blocks that were not tracked are not drawn.
    """

    def __init__(self, machine: "Machine", scenario: "Scenario", trajectory: "Trajectory") -> None:
        self._trajectory = trajectory
        structure = structure_of(machine)
        row = {block: k for k, block in enumerate(trajectory.block_ids)}
        self._parts = [(part, row[part.id]) for part in structure.parts if part.id in row]
        self._followed = next((k for part, k in self._parts if part.module.name == "Boulder"), 0)
        self._heated = {block: k for k, block in enumerate(trajectory.cannon_ids)}
        self._terrain = [
            face
            for shape in map(shape_of, scenario.terrain)
            for face in _faces(shape, shape.center, np.eye(3), _TERRAIN)
        ]
        self._signs, self._marks = [*_gates(scenario), *_edges(scenario)], scenario.marks
        self._braces = []
        for connector in machine.connectors.values():
            ends = [
                (row.get(face[0]), machine.blocks[face[0]], np.array(point))
                for face, point in (
                    (connector.start, connector.start_xyz),
                    (connector.end, connector.end_xyz),
                )
            ]
            name = f"{connector.module.name} {connector.id}"
            broken = [event.time_s for event in trajectory.breaks if event.joint == name]
            local = [
                (
                    k,
                    block.world_from_block.rotation.T @ (point - np.array(block.center_xyz)),
                )
                for k, block, point in ends
                if k is not None
            ]
            if len(local) == 2:  # noqa: PLR2004 - both ends are tracked
                color = _BRACE if connector.module.link == "rigid" else _WINCH
                self._braces.append((local, broken[0] if broken else np.inf, color))

    @property
    def azimuth_deg(self) -> float:
        """Direction of the viewer: across the gap if there is terrain, else from the south-east."""
        return -14.0 if self._terrain else -55.0

    def focus(self, sample: int) -> FloatArray:
        """Return the point to look at, (3,): the boulder, else the first tracked block."""
        position = self._trajectory.positions[sample].astype(np.float64)
        return np.asarray(position[self._followed] if len(position) else np.zeros(3))

    def reach(self) -> float:
        """Return the extent of machine, cargo and terrain from the focus at the start, units."""
        offset = self._trajectory.positions[0].astype(np.float64) - self.focus(0)
        reach = float(np.linalg.norm(offset, axis=1).max(initial=1.0))
        if self._trajectory.cargo_position is not None:
            reach = max(reach, 5.0)
        return reach + (3.0 if self._terrain else 1.0)

    def at(self, sample: int) -> Picture:
        """Return the picture of one sample."""
        trajectory, picture = self._trajectory, Picture()
        picture.faces.extend(self._terrain)
        picture.lines.extend([*self._signs, *_marks(self._marks, float(trajectory.time_s[sample]))])
        positions = trajectory.positions[sample].astype(np.float64)
        turns = rotation_of(trajectory.quaternions[sample].astype(np.float64))
        for part, k in self._parts:
            color = _COLORS[part.module.kind]
            cannon = self._heated.get(part.id)
            if cannon is not None and trajectory.heated[sample, cannon]:
                color = _HEATED
            world_from_machine = turns[k] @ part.rotation.T
            for shape in part.shapes:
                center = positions[k] + world_from_machine @ (shape.center - part.shown)
                picture.faces.extend(_faces(shape, center, world_from_machine, color))
            if part.direction is not None:
                towards = world_from_machine @ part.direction
                picture.balls.extend(
                    (positions[k] + flame.along * towards, flame.radius, _FLAME)
                    for flame in part.module.flames
                )
        for ends, until, color in self._braces:
            if trajectory.time_s[sample] < until:
                line = np.array([positions[k] + turns[k] @ local for k, local in ends])
                picture.lines.append((line, color))
        if trajectory.cargo_position is not None and trajectory.cargo_quaternion is not None:
            turn = rotation_of(trajectory.cargo_quaternion[sample].astype(np.float64))
            is_ball = trajectory.cargo_shape == "ball"
            cargo = Shape(
                kind=ShapeKind.SPHERE if is_ball else ShapeKind.BOX,
                center=trajectory.cargo_position[sample].astype(np.float64),
                rotation=turn,
                half_extents=np.array(trajectory.cargo_size) / 2,
            )
            picture.faces.extend(_faces(cargo, cargo.center, np.eye(3), _CARGO))
        return picture


def _gates(scenario: "Scenario") -> Iterator[tuple[FloatArray, Color]]:
    """Yield two posts of each gate and the line between them."""
    for gate in scenario.gates:
        heading = np.radians(gate.heading_deg)
        across = gate.half_width * np.array([np.cos(heading), -np.sin(heading), 0.0])
        middle = np.array([*gate.center, 0.0])
        west, east = middle - across, middle + across
        up = np.array([0.0, 0.0, _POST])
        yield from ((np.array(ends), _SIGN) for ends in ((west, west + up), (east, east + up)))
        yield np.array([west, east]), _SIGN


def _edges(scenario: "Scenario") -> Iterator[tuple[FloatArray, Color]]:
    """Yield both edges of the line on the ground."""
    if scenario.line is None:
        return
    middle = scenario.line.points(_LINE_SIDES)
    ahead = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    aside = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    aside *= scenario.line.half_width / np.linalg.norm(ahead, axis=1)[:, None]
    for edge in (middle + aside, middle - aside):
        rim = np.column_stack([edge, np.zeros(len(edge))])
        yield from (
            (np.array(ends), _SIGN) for ends in zip(rim, np.roll(rim, -1, axis=0), strict=True)
        )


def _marks(marks: "Sequence[Mark]", time_s: float) -> Iterator[tuple[FloatArray, Color]]:
    """Yield the level circle round each mark at its position at a time."""
    angles = np.linspace(0.0, 2 * np.pi, 2 * _ROUND_SIDES + 1)
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    for mark in marks:
        rim = np.array(mark.at(time_s)) + mark.radius * circle
        yield from ((np.array(ends), _SIGN) for ends in pairwise(rim))


def _faces(
    shape: Shape, center: FloatArray, turn: FloatArray, color: Color
) -> Iterator[tuple[FloatArray, Color]]:
    rotation = turn @ shape.rotation
    for index, corners in enumerate(polygons(_solid(shape), _ROUND_SIDES)):
        # One spoke-like lighter patch shows that a wheel turns.
        is_spoke = shape.kind is ShapeKind.CYLINDER and index == _FIRST_SIDE
        yield _shaded(center + corners @ rotation.T, center, _SPOKE if is_spoke else color)


def _solid(shape: Shape) -> Solid:
    """Return the shape about the origin of its own frame."""
    x, y, z = shape.half_extents.tolist()
    if shape.kind is ShapeKind.SPHERE:
        return Ball(radius=x, center=ORIGIN)
    if shape.kind is ShapeKind.CYLINDER:
        return Cylinder(radius=x, base=(0.0, 0.0, -z), top=(0.0, 0.0, z))
    return Box(lowest=(-x, -y, -z), highest=(x, y, z))


def _shaded(corners: FloatArray, center: FloatArray, color: Color) -> tuple[FloatArray, Color]:
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
    normal = normal / (np.linalg.norm(normal) or 1.0)
    if normal @ (corners.mean(axis=0) - center) < 0:
        corners, normal = corners[::-1], -normal
    brightness = 0.62 + 0.38 * max(0.0, float(normal @ _LIGHT))
    return corners, _scaled(color, brightness)


def _scaled(color: Sequence[int], brightness: float) -> Color:
    red, green, blue = (round(channel * brightness) for channel in color)
    return red, green, blue
