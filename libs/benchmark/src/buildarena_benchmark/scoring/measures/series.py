"""Series read from a trajectory that several scorers need."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.scenario import ReleasedPlacement

Series = NDArray[np.float64]
LASTING: Final = 3
"""Samples in a row that must exceed a bound: an impact's correction is over sooner."""


def starting_block(machine: "Machine", trajectory: "Trajectory") -> int:
    """Return the first starting block's index among the tracked blocks; 0 if none is tracked."""
    for block in machine.blocks.values():
        if block.module.kind == "start" and block.id in trajectory.block_ids:
            return trajectory.block_ids.index(block.id)
    return 0


def release_speed(scenario: "Scenario") -> float:
    """Return the speed that a scenario gives the machine at the start, units/s."""
    placement = scenario.placement
    if not isinstance(placement, ReleasedPlacement):
        return 0.0
    return float(np.linalg.norm(placement.velocity))


def lifted(scenario: "Scenario", points: Series) -> Series:
    """Return the work against gravity that brings masses from (0, 0, 0) to points, units²/s².

    Args:
        points: (..., 3) world frame, units.
    """
    planet, gravity = scenario.planet, scenario.gravity
    if planet is None:
        return np.asarray(gravity * points[..., 2])
    away = np.linalg.norm(points + np.array([0.0, 0.0, planet.radius]), axis=-1)
    return np.asarray(gravity * planet.radius * (1.0 - planet.radius / np.maximum(away, 1.0)))


def gravity_of(trajectory: "Trajectory") -> float:
    """Return a trial's downward acceleration, units/s²; the usual one for other simulators."""
    return float(trajectory.settings.get("gravity", GRAVITY))


def speeds(time_s: Series, positions: Series) -> Series:
    """Return the mean speed of each block between samples, (T - 1, N), units/s."""
    steps = np.diff(time_s)[:, None]
    return np.asarray(np.linalg.norm(np.diff(positions, axis=0), axis=2) / steps)


def tilt_deg(trajectory: "Trajectory", block: int) -> Series:
    """Return the angle from the vertical of a tracked block's first upward axis, (T,), degrees."""
    turns = rotations(trajectory.quaternions[:, block])
    up_at_start = turns[0].T @ np.array([0.0, 0.0, 1.0])
    cosine = (turns @ up_at_start)[:, 2]
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def is_lasting(beyond: NDArray[np.bool_]) -> bool:
    """Return whether `LASTING` samples in a row are beyond a bound, or all of fewer."""
    run = np.convolve(beyond.astype(int), np.ones(LASTING, dtype=int))
    return bool((run >= min(LASTING, len(beyond))).any())


def lasts(holds: NDArray[np.bool_]) -> int:
    """Return the last sample up to which something holds without a break; 0 if it never does."""
    return len(holds) - 1 if holds.all() else max(int(holds.argmin()) - 1, 0)


def rotations(quaternions: NDArray[np.floating]) -> Series:
    """Return rotation matrices, (T, 3, 3), of quaternions (T, 4) as (w, x, y, z)."""
    wxyz = quaternions.astype(np.float64)
    w, x, y, z = (wxyz / np.maximum(np.linalg.norm(wxyz, axis=1), 1e-9)[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
