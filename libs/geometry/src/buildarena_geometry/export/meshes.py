"""The solids of modules as polygons, and the colours of modules."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.modules.solids import Ball, Box, Solid

ROUND_SIDES = 24
BALL_RINGS = 8  # from pole to pole
CONNECTOR_RADIUS = 0.06  # units; connectors have no volume; this is only for display

COLOURS = {
    "start": (0.80, 0.36, 0.27),
    "block": (0.78, 0.62, 0.42),
    "joint": (0.60, 0.45, 0.62),
    "wheel": (0.33, 0.35, 0.40),
    "flight": (0.86, 0.80, 0.66),
    "cannon": (0.30, 0.55, 0.73),
    "torch": (0.91, 0.64, 0.22),
    "device": (0.55, 0.60, 0.64),
    "connector": (0.45, 0.42, 0.40),
    "cargo": (0.52, 0.60, 0.40),
}  # red, green and blue of each kind of module, 0 to 1

_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
_BOX_FACES = ((4, 6, 7, 5), (0, 1, 3, 2), (2, 3, 7, 6), (0, 4, 5, 1), (1, 5, 7, 3), (0, 2, 6, 4))


@cache
def polygons(solid: Solid, sides: int = ROUND_SIDES) -> tuple[NDArray[np.float64], ...]:
    """Return the flat faces of a solid.

    Args:
        solid: block frame, units.
        sides: number of sides of the polygon that replaces a circle.

    Returns:
        Arrays of (n, 3) corners, block frame, units, counter-clockwise seen from outside; of a
        cylinder first the base and the top.
    """
    if isinstance(solid, Box):
        corners = np.array(solid.lowest) + _CORNERS * np.array(solid.size)
        return tuple(corners[list(face)] for face in _BOX_FACES)
    angles = np.arange(sides) * (2 * math.pi / sides)
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    if isinstance(solid, Ball):
        return _ball(solid, circle)
    axis = solid.block_from_axis
    half = np.array([0.0, 0.0, solid.length / 2])
    base, top = (axis.apply(circle * solid.radius + end) for end in (-half, half))
    around = [
        np.array([base[side - 1], base[side], top[side], top[side - 1]]) for side in range(sides)
    ]
    return (base[::-1], top, *around)


def _ball(solid: Ball, circle: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return rings of quads from pole to pole; those at the poles are triangles."""
    sides, pole = len(circle), np.array([0.0, 0.0, 1.0])
    falls = np.arange(BALL_RINGS + 1) * (math.pi / BALL_RINGS)
    rings = [
        np.array(solid.center) + solid.radius * (math.sin(fall) * circle + math.cos(fall) * pole)
        for fall in falls
    ]
    faces = []
    for index, (upper, lower) in enumerate(pairwise(rings)):
        for side in range(sides):
            corners = [upper[side - 1], lower[side - 1], lower[side], upper[side]]
            if index == 0:
                del corners[3]
            elif index == BALL_RINGS - 1:
                del corners[2]
            faces.append(np.array(corners))
    return tuple(faces)


def normal(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the outward normal of a flat face, (3,), unit length.

    Args:
        polygon: (n, 3) corners, counter-clockwise seen from outside.
    """
    across = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[1])
    unit: NDArray[np.float64] = across / np.linalg.norm(across)
    return unit
