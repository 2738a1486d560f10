"""Wheel travel: the distance explained by wheels turning on the ground."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.commands import held, presses_of
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import gravity_of
from buildarena_geometry import Block, KeyPress
from buildarena_geometry.modules.solids import Cylinder

SLACK: Final = 0.5
"""Distance that counts without wheels, units: a machine rocks, and its parts give."""

ERROR: Final = 0.05
"""Share by which wheels that bounce and slip may have carried a machine farther than measured."""

_COASTING: Final = 0.5
"""Rate at which the speed that a wheel gave fades once it turns slower, g: somewhat less than the
tyres' friction brakes, so that a skid at the end of a drive counts."""

MOTOR_MARGIN: Final = 1.05
"""A wheel carries a machine no faster than this times its motor's speed at its rim."""

_TOUCH_SAMPLES: Final = 6
"""A wheel that leaves the ground for so few samples, a quarter of a second, bounces."""

Floats = NDArray[np.float64]


def driven_distances(run: Run, path: Floats, *, since: int = 0) -> Floats | None:
    """Return the distance from the start of a path that wheels explain, with a tolerance, (T,).

    A powered wheel in contact with ground or terrain, joined to the starting block, drives the
    machine as far as it rolls while its motor is commanded that way: by the horizontal motion of
    its centre along its rolling direction, at most by its turning times its radius and by what its
    motor can do, and aside by no more than ahead. Turning slower, or without a command, takes
    the speed that it gave away gradually, so a skid after a drive counts. Between two samples the
    machine is driven as much as its best wheel: that share of the motion of each wheel in contact
    counts. The distance is the largest of the wheels' displacements made up so, and of the one
    that is made up of whichever wheel moved farthest at the time (wheels may take turns), in
    the direction of the path's, with `ERROR` and `SLACK` added, units.

    Args:
        path: (T, 2) or (T, 3) of the subject.
        since: Sample from which on wheels drive, and from whose place distances count.

    Returns:
        None where the trajectory has no forces on the wheels, or not how they move.
    """
    bearing = run.trajectory.bearing
    index = {block: i for i, block in enumerate(run.trajectory.block_ids)}
    if bearing is None or not index.keys() >= set(bearing.wheel_ids):
        return None
    columns = [
        column
        for column, wheel in enumerate(bearing.wheel_ids)
        if run.machine.blocks[wheel].module.motor
    ]
    if not columns:
        return np.full(len(path), SLACK)
    moves, shares = [], []
    presses = presses_of(run)
    for column in columns:
        wheel = run.machine.blocks[bearing.wheel_ids[column]]
        row = index[wheel.id]
        touches = (_extend(bearing.wheels[:, column] > 0.0) & run.joined[:, row])[1:]
        limits = _key_speeds(wheel, presses, run)
        moved, share = _rolled_steps(run, row, touches, limits, radius_of(wheel))
        moves.append(np.where(touches[:, None], moved, 0.0))
        shares.append(np.where(touches, share, 0.0))
    driven = np.max(shares, axis=0)[None, :, None] * np.array(moves)
    farthest = np.linalg.norm(driven, axis=2).argmax(axis=0)
    in_turns = np.take_along_axis(driven, farthest[None, :, None], axis=0)
    driven = np.concatenate([driven, in_turns])
    away = path[:, :2] - path[since, :2]
    direction = away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None]
    carried = np.zeros((len(driven), *away.shape))
    carried[:, since + 1 :] = np.cumsum(driven[:, since:], axis=1)
    explained = (carried * direction).sum(axis=2).max(axis=0).clip(0.0)
    return np.asarray(explained * (1.0 + ERROR) + SLACK)


def explained_distances(run: Run, path: Floats, *, since: int = 0) -> Floats:
    """Return the distance that counts as driven upright, (T,); infinite if not measured.

    Args:
        path: (T, 2) or (T, 3) of the subject.
        since: Sample from whose place distances count.
    """
    driven = driven_distances(run, path, since=since)
    if driven is None:
        return np.full(len(path), np.inf)
    return np.minimum(driven, moved_upright(run, path, since=since))


def is_driven(run: Run, path: Floats, since: int = 0) -> Mask:
    """Return when wheels explain how far a subject is from where it was at a sample, (T,).

    Args:
        path: (T, 2) or (T, 3) of the subject.
    """
    gone = np.linalg.norm(path[:, :2] - path[since, :2], axis=1)
    return np.asarray(gone <= explained_distances(run, path, since=since))


def moved_upright(run: Run, path: Floats, *, since: int = 0) -> Floats:
    """Return how far a subject can get, (T,), if the machine, with all blocks joined, only turned.

    A machine that moves and turns on the ground takes no block farther than another by more than
    twice the horizontal distance between them; one that falls over does.

    Args:
        path: (T, 2) or (T, 3) of the subject.
        since: Sample from whose place distances count.
    """
    positions = run.positions[:, :, :2]
    offset = np.linalg.norm(positions[since] - path[since, :2], axis=1)
    moved = np.linalg.norm(positions - positions[since], axis=2)
    reach = np.where(run.joined, moved + 2.0 * offset, np.inf)
    return np.asarray(reach.min(axis=1, initial=np.inf) + SLACK)


def radius_of(wheel: "Block") -> float:
    """Return a wheel's radius, units."""
    radii = [solid.radius for solid in wheel.module.body if isinstance(solid, Cylinder)]
    boxes = [max(solid.size) / 2 for solid in wheel.module.body if not isinstance(solid, Cylinder)]
    return float(max(radii or boxes, default=0.0))


def _key_speeds(wheel: "Block", presses: "Sequence[KeyPress]", run: Run) -> Floats:
    """Return the least and greatest speed that its motor is commanded between samples, (2, T - 1).

    Rad/s about the wheel's outward axis, with a margin; 0 both where no key is held, or keys for
    both ways are: it brakes.
    """
    motor = wheel.module.motor
    assert motor is not None  # noqa: S101 - the caller looked
    speed = MOTOR_MARGIN * motor.speed
    ahead, back = (held(wheel, way, presses, run) for way in (motor.forward, motor.backward))
    forward, backward = (speed * (way[1:] | way[:-1]) for way in (ahead & ~back, back & ~ahead))
    # Clockwise seen from outside is against the outward axis.
    return np.array([-forward, backward] if wheel.forward_is_clockwise else [-backward, forward])


def _rolled_steps(
    run: Run, row: int, touches: Mask, limits: Floats, radius: float
) -> tuple[Floats, Floats]:
    """Return a wheel's steps, (T - 1, 2) units, horizontal, and their rolled shares, (T - 1,)."""
    steps_s = np.diff(run.time_s)
    moved = np.diff(run.positions[:, row, :2], axis=0)
    axle, turn = _axle_turning(run.trajectory.quaternions[:, row].astype(np.float64))
    ahead = np.column_stack([axle[:, 1], -axle[:, 0]])
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
    along = (moved * ahead).sum(axis=1)
    rolled = np.where(touches, np.clip(turn, *(limits * steps_s)) * radius, 0.0)
    credit = np.zeros(len(along))
    speed, fading = 0.0, _COASTING * gravity_of(run.trajectory)
    for k, step_s in enumerate(steps_s):
        coasted = np.copysign(max(abs(speed) - fading * step_s, 0.0) * step_s, speed)
        low, high = min(rolled[k], coasted, 0.0), max(rolled[k], coasted, 0.0)
        credit[k] = min(max(along[k], low), high)
        speed = credit[k] / step_s
    length = np.linalg.norm(moved, axis=1)
    aside = np.sqrt(np.maximum(length**2 - along**2, 0.0))
    rolled_share = np.abs(credit) / np.maximum(np.abs(along), 1e-9)
    covered = np.hypot(credit, np.minimum(aside * rolled_share, np.abs(credit)))
    return moved, np.minimum(covered / np.maximum(length, 1e-9), 1.0)


def _extend(touches: Mask) -> Mask:
    """Return the touches, and the few samples around each."""
    extended = touches.copy()
    for samples in range(1, _TOUCH_SAMPLES + 1):
        extended[samples:] |= touches[:-samples]
        extended[:-samples] |= touches[samples:]
    return extended


def _axle_turning(quaternions: Floats) -> tuple[Floats, Floats]:
    """Return a wheel's axle, (T - 1, 3), and turning about it, (T - 1,) radians, between samples.

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
