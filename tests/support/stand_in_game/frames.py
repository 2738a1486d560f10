"""From the game's left-handed components (x east, y up, z north) to the world's and back.

The world here is ours: x east, y north, z up, right-handed. Points and directions swap their last
two components. A block's frame in our catalogue has +z away from the face it sits on and the game's
y; its x is the other way round, so that it is right-handed. The starting block has the world's axes
in both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
START = 0


def swapped(points: ArrayLike) -> Array:
    """Points or directions, (..., 3), of one world in the other's components."""
    return np.asarray(points, np.float64)[..., [0, 2, 1]]


def matrix(rotation: tuple[float, float, float, float]) -> Array:
    """The matrix (3, 3) of a rotation x, y, z, w; its columns are the game's axes of a block."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotated(
    rotation: tuple[float, float, float, float], vector: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A vector turned by a rotation x, y, z, w, in the game's components."""
    x, y, z = matrix(rotation) @ np.array(vector)
    return (float(x), float(y), float(z))


def world_axes(rotation: tuple[float, float, float, float]) -> Array:
    """The columns (3, 3): a block's right, up and forward in the world's components."""
    return swapped(matrix(rotation).T).T


def our_rotation(type_id: int, rotation: tuple[float, float, float, float]) -> Array:
    """world_from_block (3, 3), right-handed, of a block's frame as our catalogue has it."""
    right, up, forward = world_axes(rotation).T
    if type_id == START:
        return np.column_stack([right, forward, up])
    return np.column_stack([-right, up, forward])


def quaternion(rotation: Array) -> tuple[float, float, float, float]:
    """The quaternion (w, x, y, z) of a rotation matrix (3, 3)."""
    m = rotation
    choices = np.array(
        [
            1 + m[0, 0] + m[1, 1] + m[2, 2],
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    k = int(choices.argmax())
    a, b, c = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    d, e, f = m[1, 0] + m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2]
    rows = ((choices[0], a, b, c), (a, choices[1], d, e), (b, d, choices[2], f))
    found = np.array((*rows, (c, e, f, choices[3]))[k])
    w, x, y, z = found / np.linalg.norm(found)
    return (float(w), float(x), float(y), float(z))


def from_quaternion(wxyz: ArrayLike) -> Array:
    """The rotation matrix (3, 3) of a quaternion (w, x, y, z)."""
    w, x, y, z = (float(part) for part in np.asarray(wxyz, np.float64))
    return matrix((x, y, z, w))
