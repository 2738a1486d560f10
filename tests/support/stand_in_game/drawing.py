"""Draws the machine and the world in side view: east to the right, up upwards."""

from __future__ import annotations

import math
import tkinter as tk
from typing import Final

import numpy as np

from stand_in_game.frames import Array
from stand_in_game.game import Game
from stand_in_game.machine_file import BALLAST, CONNECTORS
from stand_in_game.trial import Part

_COLORS: Final = {
    0: (150, 120, 80),
    2: (110, 110, 120),
    15: (190, 150, 95),
    35: (90, 95, 110),
    47: (205, 110, 60),
    56: (110, 150, 185),
}
_SIZES: Final = {
    0: ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)),
    15: ((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0)),
    35: ((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0)),
    47: ((-0.25, -0.5, 0.0), (0.25, 1.0, 0.75)),
    56: ((-0.5, -1.0, 0.0), (0.5, 0.75, 1.0)),
}
_UNIT: Final = 0.026
"""Length of a unit, in widths of the window."""
_FLOOR: Final = 0.83
_WHEEL_CORNERS: Final = np.array(
    [
        (math.cos(k * math.pi / 5), math.sin(k * math.pi / 5), z)
        for k in range(10)
        for z in (0.0, 0.5)
    ]
)


class Scene:
    """Draws what the game shows of the world.

    Args:
        canvas: what it is drawn on.
        size: the window's width and height, pixels.
    """

    def __init__(self, canvas: tk.Canvas, size: tuple[int, int]) -> None:
        self._canvas, (self._width, self._height) = canvas, size
        self._unit = _UNIT * self._width
        self._eye = np.zeros(2)

    def draw(self, game: Game) -> None:
        """Draws everything anew."""
        self._canvas.delete("scene")
        parts = self._parts(game)
        self._look_at(parts)
        self._world(game)
        for place, part in sorted(parts, key=lambda pair: -pair[1].position[2]):
            self._block(game, place, part)
        self._canvas.tag_lower("scene")

    def _parts(self, game: Game) -> list[tuple[int, Part]]:
        if game.placed is None:
            return []
        return [(place, game.part(place)) for place in range(len(game.placed.file.blocks))]

    def _look_at(self, parts: list[tuple[int, Part]]) -> None:
        """Follows the machine once it leaves the middle of the picture."""
        if not parts:
            self._eye = np.zeros(2)
            return
        middle = np.mean([part.position[:2] for _, part in parts], axis=0)
        self._eye[0] = middle[0]
        self._eye[1] = max(0.0, middle[1] - 12.0)

    def _pixel(self, points: Array) -> Array:
        x = self._width / 2 + (points[:, 0] - self._eye[0]) * self._unit
        y = self._height * _FLOOR - (points[:, 1] - self._eye[1]) * self._unit
        return np.column_stack([x, y])

    def _world(self, game: Game) -> None:
        canvas, width, height = self._canvas, self._width, self._height
        floor = float(self._pixel(np.zeros((1, 2)))[0, 1])
        canvas.create_rectangle(0, 0, width, height, fill="#cfe0ea", width=0, tags="scene")
        for box in game.terrain:
            (x, _, z), (wide, _, tall) = box.center, box.size
            corners = np.array([[x - wide / 2, z + tall / 2], [x + wide / 2, z - tall / 2]])
            (a, b), (c, d) = self._pixel(corners)
            canvas.create_rectangle(
                a, b, c, d, fill="#a8b39a", outline="#7d8a70", stipple="gray50", tags="scene"
            )
        canvas.create_rectangle(0, floor, width, height, fill="#8fa07c", width=0, tags="scene")
        first = math.floor(self._eye[0]) - 24
        for unit in range(first - first % 2, first + 50, 2):
            x = float(self._pixel(np.array([[unit, 0.0]]))[0, 0])
            shade = "#6f8060" if unit % 10 else "#4c5a40"
            canvas.create_line(x, floor, x - 14, floor + 40, fill=shade, tags="scene")

    def _block(self, game: Game, place: int, part: Part) -> None:
        assert game.placed is not None
        block = game.placed.file.blocks[place]
        axes = np.column_stack([part.right, part.up, part.forward])
        root = np.array(part.position)
        if part.type_id in CONNECTORS:
            span = np.array(block.vector("end-position") or (0.0, 0.0, 0.0))
            ends = self._pixel(np.array([root, root + axes @ span]))
            color = "#5b4a36" if part.type_id == CONNECTORS[0] else "#b9a97f"
            self._canvas.create_line(*ends.ravel(), width=3, fill=color, tags="scene")
            return
        corners = _corners(part.type_id)
        if part.type_id == BALLAST:
            corners = corners * np.array(block.scale)
        outline = _hull(self._pixel(root + corners @ axes.T))
        # Blocks further to the north are darker, so that depth shows.
        shade = max(0.6, min(1.1, 1.0 - 0.03 * (part.position[2])))
        fill = _color(part.type_id, shade)
        if part.burning:
            fill = "#e8542b"
        self._canvas.create_polygon(
            *outline.ravel(), fill=fill, outline="#3a3226", width=1, tags="scene"
        )
        if part.type_id == 2:
            spoke = self._pixel(np.array([root - 0.8 * axes[:, 0], root + 0.8 * axes[:, 0]]))
            self._canvas.create_line(*spoke.ravel(), width=2, fill="#e8e4da", tags="scene")


def _corners(type_id: int) -> Array:
    if type_id == 2:
        return _WHEEL_CORNERS
    low, high = _SIZES.get(type_id, ((-0.3, -0.3, 0.0), (0.3, 0.3, 0.6)))
    steps = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    return np.asarray(np.array(low) + steps * (np.array(high) - np.array(low)))


def _color(type_id: int, shade: float) -> str:
    red, green, blue = (
        min(255, int(part * shade)) for part in _COLORS.get(type_id, (140, 90, 140))
    )
    return f"#{red:02x}{green:02x}{blue:02x}"


def _hull(points: Array) -> Array:
    """The outline of points in the plane, (H, 2), by Andrew's monotone chain."""
    ordered = sorted({(round(float(x), 2), round(float(y), 2)) for x, y in points})
    if len(ordered) < 3:
        return np.array([*ordered, *ordered, *ordered])[:3]
    chains = []
    for line in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for point in line:
            while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chains += chain[:-1]
    return np.array(chains)


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
