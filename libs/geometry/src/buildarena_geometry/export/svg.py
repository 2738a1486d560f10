"""Drawings of machines as SVG: parallel projection, painted from the back to the front."""

import math
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.blocks import Block
from buildarena_geometry.export.meshes import COLOURS, ROUND_SIDES, normal, polygons
from buildarena_geometry.machine import Machine
from buildarena_geometry.modules.module import Module
from buildarena_geometry.modules.solids import Box
from buildarena_geometry.poses import Pose

_LIGHT = np.array([0.35, -0.5, 0.79])  # where the light comes from, world frame, unit length
PICTURE = 200.0  # pixels that the longest side of a module takes where no view is given
_DIGITS = 6  # decimals that count: the last bits of a product differ from processor to processor
_DARKEST = 0.55  # brightness of a face turned away from the light
_AXES = (
    ("east", (1, 0, 0), "#c0392b"),
    ("north", (0, 1, 0), "#27883f"),
    ("up", (0, 0, 1), "#2c5fb3"),
)
_STYLE = """
polygon {stroke-width: 1; stroke-linejoin: round}
.rod {stroke: #4a4441; stroke-width: 6; stroke-linecap: round}
.arrow {stroke-width: 3}
text {font: 600 15px sans-serif; text-anchor: middle; dominant-baseline: central;
  paint-order: stroke; stroke: #fff; stroke-width: 4}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Scale and labels of a drawing of a machine.

    Attributes:
        scale: pixels per unit.
        compass: true to show arrows for east, north and up.
        face_labels: ids of the blocks whose visible free faces are labelled.
        frames: ids of the blocks whose axes are drawn (x red, y green, z blue).
        ids: true to write each block's id on it.
    """

    scale: float = 80.0
    compass: bool = True
    face_labels: tuple[str, ...] = ()
    frames: tuple[str, ...] = ()
    ids: bool = False


def machine_svg(machine: Machine, view: View | None = None) -> str:
    """Return the machine as an SVG document.

    Args:
        machine: machine to draw; an empty one gives an empty drawing.

    Returns:
        The document's text.
    """
    drawing = _Drawing(view or View())
    for block in machine.blocks.values():
        drawing.add_block(block, machine.state.free_faces(block))
    for link in machine.connectors.values():
        drawing.add_rod(np.array(link.start_xyz), np.array(link.end_xyz))
    return drawing.text()


def module_svg(module: Module) -> str:
    """Return a module as an SVG document: root point at the origin, axes, and the faces' letters.

    Args:
        module: module to draw; a connector is drawn as a rod.
    """
    pose = Pose()
    if module.kind == "connector":
        drawing = _Drawing(View(compass=False))
        drawing.add_rod(pose.position, np.array([2.0, 0.0, 0.0]))
        return drawing.text()
    size = max(module.size or (1.0,))
    scale = min(80.0, PICTURE / max(1.0, size))
    drawing = _Drawing(View(scale=scale, compass=False, face_labels=("1",), frames=("1",)))
    block = Block(id="1", module=module, world_from_block=pose)
    drawing.add_block(block, list(module.face_of_label))
    return drawing.text()


class _Drawing:
    """Collects shapes with their depth and writes them from the back to the front."""

    def __init__(self, view: View) -> None:
        azimuth, elevation = math.radians(30), math.radians(25)
        right = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        level = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0]) * math.cos(elevation)
        self._towards_eye = level + np.array([0.0, 0.0, math.sin(elevation)])
        self._axes = np.array([right, np.cross(self._towards_eye, right)])
        self._view = view
        self._shapes: list[tuple[float, str]] = []
        self._writing: list[str] = []
        self._points: list[NDArray[np.float64]] = []

    def add_block(self, block: Block, free_faces: list[str]) -> None:
        for solid in block.module.body:
            for polygon in polygons(solid):
                # A cylinder's side is round: only its two ends have edges.
                edged = isinstance(solid, Box) or len(polygon) == ROUND_SIDES
                corners = block.world_from_block.apply(polygon)
                self._add_polygon(corners, block.module.kind, edged=edged)
        if self._view.ids:
            self._write(np.array(block.center_xyz), block.id, "id")
        for label in free_faces if block.id in self._view.face_labels else ():
            if np.array(block.face_normal(label)) @ self._towards_eye > 0:
                self._write(np.array(block.face_center(label)), label, "face")
        if block.id in self._view.frames:
            pose = block.world_from_block
            for axis, (_, _, colour) in zip(pose.rotation.T, _AXES, strict=True):
                tip = self._project(pose.position + 0.9 * axis)
                self._arrow(self._project(pose.position), tip, colour)

    def add_rod(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> None:
        (x, y), (u, v) = self._project(start), self._project(end)
        depth = float((start + end) @ self._towards_eye / 2)
        line = f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" class="rod"/>'
        self._shapes.append((depth, line))

    def text(self) -> str:
        if self._view.compass:
            self._add_compass()
        points = np.array(self._points or [np.zeros(2)])
        (left, top), (right, bottom) = points.min(axis=0) - 24, points.max(axis=0) + 24
        shapes = [shape for _, shape in sorted(self._shapes, key=lambda entry: entry[0])]
        box = f"{left:.0f} {top:.0f} {right - left:.0f} {bottom - top:.0f}"
        frame = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" '
            f'width="{right - left:.0f}" height="{bottom - top:.0f}">'
        )
        paper = f'<rect x="{left:.0f}" y="{top:.0f}" width="100%" height="100%" fill="#fff"/>'
        lines = [frame, f"<style>{_STYLE}</style>", paper, *shapes, *self._writing, "</svg>"]
        return "\n".join(lines) + "\n"

    def _add_polygon(self, corners: NDArray[np.float64], kind: str, *, edged: bool) -> None:
        outward = normal(corners)
        if round(float(outward @ self._towards_eye), _DIGITS) <= 0:
            return
        lit = round(float(outward @ _LIGHT), _DIGITS)
        brightness = _DARKEST + (1 - _DARKEST) * max(0.0, lit)
        red, green, blue = (round(255 * part * brightness) for part in COLOURS[kind])
        flat = [self._project(corner) for corner in corners]
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in flat)
        depth = round(float(corners.mean(axis=0) @ self._towards_eye), _DIGITS)
        colour = f"#{red:02x}{green:02x}{blue:02x}"
        edge = "#2b2b2b" if edged else colour
        polygon = f'<polygon points="{points}" fill="{colour}" stroke="{edge}"/>'
        self._shapes.append((depth, polygon))

    def _add_compass(self) -> None:
        flat = np.array(self._points or [np.zeros(2)])
        left, bottom = flat[:, 0].min() - 40, flat[:, 1].max()
        for name, axis, colour in _AXES:
            across, up = self._axes @ np.array(axis) * 46
            tip = np.array([left + across, bottom - up])
            self._arrow(np.array([left, bottom]), tip, colour)
            written = np.array([left + 1.6 * across, bottom - 1.6 * up])
            self._points.append(written)
            self._writing.append(
                f'<text x="{written[0]:.1f}" y="{written[1]:.1f}" fill="{colour}">{name}</text>'
            )

    def _arrow(self, start: NDArray[np.float64], end: NDArray[np.float64], colour: str) -> None:
        (x, y), (u, v) = start, end
        self._writing.append(
            f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" stroke="{colour}" '
            f'class="arrow"/><circle cx="{u:.1f}" cy="{v:.1f}" r="4" fill="{colour}"/>'
        )

    def _write(self, place: NDArray[np.float64], text: str, meaning: str) -> None:
        x, y = self._project(place)
        self._writing.append(
            f'<text x="{x:.1f}" y="{y:.1f}" class="{meaning}">{escape(text)}</text>'
        )

    def _project(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        # Rounded, every processor gives the same; the zero makes 0 of -0.
        across, up = np.round(self._axes @ point * self._view.scale, _DIGITS) + 0.0
        flat = np.array([across, -up])
        self._points.append(flat)
        return flat
