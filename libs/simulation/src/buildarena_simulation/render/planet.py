"""A flight round a planet as pictures of flat ground that rolls by, with a map of the path."""

from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_simulation.render.scene import Color, Picture
from buildarena_simulation.structure.model import FloatArray

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

    from buildarena_simulation.trajectory import Trajectory

_PLANET: Final[Color] = (205, 211, 200)
_RIM: Final[Color] = (120, 132, 118)
_PATH: Final[Color] = (194, 65, 12)
_HERE: Final[Color] = (30, 34, 40)
_MAP: Final = 0.3
"""The map's share of the picture's height."""
_REACH: Final = 0.42
"""The greatest distance from the planet's centre on the map, as a share of the map's edge."""


class Flight:
    """Path of the first tracked block, seen by an observer who follows it.

    The ground below it is drawn flat: it is unrolled along the path, so that it passes at its true
    speed.

    Args:
        radius: Radius of the planet, whose centre is that far below (0, 0, 0), units.
    """

    def __init__(self, trajectory: "Trajectory", radius: float) -> None:
        self._center = np.array([0.0, 0.0, -radius])
        path = trajectory.positions[:, 0].astype(np.float64) - self._center
        away = np.linalg.norm(path, axis=1)
        self._radius, self.height = radius, away - radius
        ups = path / away[:, None]
        self._feet = radius * ups
        turn, place = np.eye(3), np.zeros(3)
        self._turns, self._places = [], []
        for k, up in enumerate(ups):
            below = turn @ up
            if k:
                place = place + radius * np.array([*below[:2], 0.0])
            turn = _upright(below) @ turn
            self._turns.append(turn)
            self._places.append(place)
        self._map = _flat(path)

    def unrolled(self, picture: Picture, sample: int) -> Picture:
        """Return a moment's picture in a frame with level, flat ground below the block."""

        def at(points: FloatArray) -> FloatArray:
            arms = points - self._center - self._feet[sample]
            return np.asarray(arms @ self._turns[sample].T + self._places[sample])

        return Picture(
            faces=[(at(corners), color) for corners, color in picture.faces],
            lines=[(at(ends), color) for ends, color in picture.lines],
            balls=[(at(center), radius, color) for center, radius, color in picture.balls],
        )

    def focus(self, sample: int) -> FloatArray:
        """Return the block's position in that frame, (3,), units."""
        return np.asarray(self._places[sample] + np.array([0.0, 0.0, self.height[sample]]))

    def draw_map(self, canvas: "ImageDraw", size: tuple[int, int], sample: int) -> None:
        """Draw planet and path so far at the right, in the plane of the path's largest turn.

        Args:
            size: Width and height, pixels.
            sample: Index of the sample.
        """
        edge = _MAP * size[1]
        middle = np.array([size[0] - edge / 2 - 8, edge / 2 + 8])
        scale = _REACH * edge / max(float(np.linalg.norm(self._map, axis=1).max()), self._radius)
        r = scale * self._radius
        x, y = middle
        canvas.ellipse([x - r, y - r, x + r, y + r], fill=_PLANET, outline=_RIM)
        points = middle + scale * self._map[: sample + 1] * [1, -1]
        if sample:
            canvas.line([(float(px), float(py)) for px, py in points], fill=_PATH, width=2)
        px, py = points[-1]
        canvas.ellipse([px - 3, py - 3, px + 3, py + 3], fill=_HERE)


def _upright(up: FloatArray) -> FloatArray:
    """Return the least turn that brings a direction to the vertical, (3, 3)."""
    x, y, z = up
    if z < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + z))


def _flat(path: FloatArray) -> FloatArray:
    """Project the path to the plane in which it turns most, its beginning upwards, (T, 2)."""
    first = path[0] / np.linalg.norm(path[0])
    axis = np.cross(path[:-1], path[1:]).sum(axis=0)
    axis -= (axis @ first) * first
    if np.linalg.norm(axis) < 1e-9:  # noqa: PLR2004 - it goes straight up
        axis = np.array([0.0, 1.0, 0.0])
    aside = np.cross(axis / np.linalg.norm(axis), first)
    return np.column_stack([path @ aside, path @ first])
