"""How far wheels have carried a machine: what their turning on the ground explains."""

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scorers.pieces import Mask
from buildarena_geometry.modules.module import Cylinder
from buildarena_simulation.constants import GRAVITY

if TYPE_CHECKING:
    from buildarena_geometry import Block, Machine
    from buildarena_simulation import Trajectory

SLACK: Final = 0.5
"""Distance that counts without wheels, units: a machine rocks, and its parts give."""

_COASTING: Final = 0.5 * GRAVITY
"""How fast the speed that a wheel gave fades once it turns slower, units/s²: somewhat less than
the tyres' friction brakes, so that a skid at the end of a drive counts."""

_TOUCH_SAMPLES: Final = 2
"""A wheel that leaves the ground for so few samples bounces."""

Floats = NDArray[np.float64]


def driven_distances(
    machine: "Machine", trajectory: "Trajectory", joined: Mask, path: Floats
) -> Floats | None:
    """How far wheels explain that a path leads away from its start, (T,), units.

    A powered wheel that bears on ground or terrain, joined to the starting block, carries the
    machine along by as much as it rolls: by the horizontal motion of its centre along its rolling
    direction, at most by its turning times its radius, and aside by no more than ahead. Slower
    turning takes the speed that it gave away gradually, so a skid after a drive counts. The
    distance is the largest of the wheels' displacements so far in the direction of the path's.

    Args:
        machine: Gives the wheels.
        trajectory: Gives their motion, and what bears them.
        joined: (T, N) as `joined_to_start` says.
        path: (T, 2) or (T, 3) of what is transported.

    Returns:
        None where the trajectory does not tell what bears the wheels.
    """
    bearing = trajectory.bearing
    if bearing is None:
        return None
    away = path[:, :2] - path[0, :2]
    direction = away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None]
    index = {block: i for i, block in enumerate(trajectory.block_ids)}
    best = np.zeros(len(path))
    for column, wheel in enumerate(bearing.wheel_ids):
        block = machine.blocks[wheel]
        if wheel not in index or not block.module.spins:
            continue
        row = index[wheel]
        touches = _lasting(bearing.wheels[:, column] > 0.0) & joined[:, row]
        carried = _carried(trajectory, row, touches[1:], joined[1:, row], radius_of(block))
        best = np.maximum(best, (carried * direction).sum(axis=1))
    return best


def radius_of(wheel: "Block") -> float:
    """A wheel's radius, units."""
    radii = [solid.radius for solid in wheel.module.body if isinstance(solid, Cylinder)]
    boxes = [
        max(solid.size) / 2 for solid in wheel.module.body if not isinstance(solid, Cylinder)
    ]
    return float(max(radii or boxes, default=0.0))


def _carried(
    trajectory: "Trajectory", row: int, touches: Mask, joined: Mask, radius: float
) -> Floats:
    """Where a wheel has carried its machine, (T, 2) from its start, units."""
    steps_s = np.diff(trajectory.time_s)
    position = trajectory.positions[:, row, :2].astype(np.float64)
    moved = np.diff(position, axis=0)
    axle, turn = _turning(trajectory.quaternions[:, row].astype(np.float64))
    ahead = np.column_stack([axle[:, 1], -axle[:, 0]])
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
    along = (moved * ahead).sum(axis=1)
    aside = moved - along[:, None] * ahead
    rolled = np.where(touches, turn * radius, 0.0)
    credit = np.zeros(len(along))
    speed = 0.0
    for k, step_s in enumerate(steps_s):
        fade = max(abs(speed) - _COASTING * step_s, 0.0) if joined[k] else 0.0
        kept = np.copysign(fade * step_s, speed)
        low, high = min(rolled[k], kept, 0.0), max(rolled[k], kept, 0.0)
        credit[k] = min(max(along[k], low), high)
        speed = credit[k] / step_s
    share = np.minimum(np.abs(credit) / np.maximum(np.linalg.norm(aside, axis=1), 1e-9), 1.0)
    whole = np.abs(credit) / np.maximum(np.abs(along), 1e-9)
    carried = credit[:, None] * ahead + aside * np.minimum(share, whole)[:, None]
    return np.vstack([np.zeros((1, 2)), np.cumsum(carried, axis=0)])


def _lasting(touches: Mask) -> Mask:
    """Touches that are no more than a few samples away."""
    near = touches.copy()
    for samples in range(1, _TOUCH_SAMPLES + 1):
        near[samples:] |= touches[:-samples]
        near[:-samples] |= touches[samples:]
    return near


def _turning(quaternions: Floats) -> tuple[Floats, Floats]:
    """A wheel's axle, (T - 1, 3), and its turning about it, (T - 1,) radians, between samples.

    It is positive where the wheel rolls along axle x up.
    """
    unit = quaternions / np.maximum(np.linalg.norm(quaternions, axis=1), 1e-9)[:, None]
    w, x, y, z = unit.T
    axles = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    axle = (axles[1:] + axles[:-1]) / 2
    before, after = unit[:-1], unit[1:]
    scalar = (before * after).sum(axis=1)
    vector = (
        before[:, :1] * after[:, 1:]
        - after[:, :1] * before[:, 1:]
        + np.cross(before[:, 1:], after[:, 1:])
    )
    vector *= np.where(scalar < 0.0, -1.0, 1.0)[:, None]
    sine = np.linalg.norm(vector, axis=1)
    angle = 2.0 * np.arctan2(sine, np.abs(scalar))
    spin = vector * (angle / np.maximum(sine, 1e-12))[:, None]
    return axle, (spin * axle).sum(axis=1)
