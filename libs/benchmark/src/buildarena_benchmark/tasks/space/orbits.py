"""Paths round a point: how far they go round it."""

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.series import Series


def swept(path: NDArray[np.floating], center: NDArray[np.floating]) -> Series:
    """Return how far a path has gone round a point at each of its places, (N,), rad.

    Each step turns the direction from the point to the place by an angle about an axis. What counts
    is the sum of these turns about the axis about which the whole path turns most, from 0 on. So
    what goes back is taken off again, and a circle that is seen from the point under a half angle
    of a counts sin² a times: circling over one place is worth next to nothing.

    Args:
        path: (N, 3) places, units.
        center: (3,) the point.
    """
    arms = path.astype(np.float64) - center
    crossed = np.cross(arms[:-1], arms[1:])
    sine = np.linalg.norm(crossed, axis=1)
    angle = np.arctan2(sine, (arms[:-1] * arms[1:]).sum(axis=1))
    turns = np.cumsum(crossed * (angle / np.maximum(sine, 1e-300))[:, None], axis=0)
    total = float(np.linalg.norm(turns[-1])) if len(turns) else 0.0
    if total == 0.0:
        return np.zeros(len(path))
    return np.concatenate([[0.0], turns @ turns[-1] / total])
