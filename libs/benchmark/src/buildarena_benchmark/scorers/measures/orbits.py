"""Paths round a point: how far they go round it."""

import numpy as np
from numpy.typing import NDArray

Series = NDArray[np.float64]


def swept(path: NDArray[np.floating], center: NDArray[np.floating]) -> Series:
    """How far a path has gone round a point at each of its places, (N,), rad.

    The angle about the axis about which the whole path turns most, from 0 on: what goes back is
    taken off again, so that swinging to and fro is worth nothing.

    Args:
        path: (N, 3) places, units.
        center: (3,) the point.
    """
    arms = path.astype(np.float64) - center
    crossed = np.cross(arms[:-1], arms[1:])
    axis = crossed.sum(axis=0)
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        return np.zeros(len(path))
    axis = axis / length
    level = arms - (arms @ axis)[:, None] * axis
    sine = np.cross(level[:-1], level[1:]) @ axis
    cosine = (level[:-1] * level[1:]).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(np.arctan2(sine, cosine))])
