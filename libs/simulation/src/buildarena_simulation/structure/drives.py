"""Effect of the keys on a joint's drive: its target at every step."""

import math
from typing import Final

import numpy as np

from buildarena_geometry.modules.joints import Drive
from buildarena_simulation.structure.model import FloatArray

_FEW: Final = 400
"""Maximum number of speeds that are computed one by one."""


def speed_targets(
    drive: Drive,
    forward: FloatArray,
    backward: FloatArray,
    *,
    sign: float,
    time_step_s: float,
    before: float,
) -> tuple[FloatArray, float]:
    """Return a drive's target speeds, (S,), rad/s or units/s; NaN where it turns freely.

    Args:
        drive: A drive for a speed.
        forward: (S,) command forward at each step, 0 to 1.
        backward: (S,) command backward.
        sign: Sense of forward along the joint's axis, ±1.
        time_step_s: Length of a step, seconds.
        before: Its speed before the first step.

    Returns:
        The speeds, and the last one.
    """
    if drive.default_mode == "forward":
        forward = np.ones_like(forward)
    commands = sign * drive.rate * (forward - backward)
    blend = blends(np.array([drive.lag_per_s]), time_step_s)
    speeds, reached = lagged(commands[:, None], blend, before=np.array([before]))
    speeds = speeds[:, 0]
    if drive.default_mode == "free":
        speeds[(forward == 0) & (backward == 0)] = np.nan
    return speeds, float(reached[0])


def place_targets(
    drive: Drive,
    forward: FloatArray,
    backward: FloatArray,
    *,
    sign: float,
    limits: tuple[float, float] | None,
    time_step_s: float,
    place: float,
) -> FloatArray:
    """Return a drive's target positions, (S,), rad or units; commands move them at its rate.

    Args:
        drive: A drive for a place.
        forward: (S,) command forward at each step, 0 to 1.
        backward: (S,) command backward.
        sign: Sense of forward along the joint's axis, ±1.
        limits: Minimum and maximum position; None if unlimited.
        time_step_s: Length of a step, seconds.
        place: Its target before the first step.
    """
    low, high = limits or (-math.inf, math.inf)
    move = sign * drive.rate * time_step_s * (forward - backward)
    back = drive.rate * time_step_s if drive.default_mode == "return" else 0.0
    targets = np.zeros(len(move))
    if place == 0 and not (forward.any() or backward.any()):
        return targets
    asked = (forward > 0) | (backward > 0)
    for k, (step, pressed) in enumerate(zip(move.tolist(), asked.tolist(), strict=True)):
        if pressed:
            place = min(max(place + step, low), high)
        elif back:
            place -= min(max(place, -back), back)
        targets[k] = place
    return targets


def blends(lags: FloatArray, time_step_s: float) -> FloatArray:
    """Return the share of the distance to its target that a speed covers in a step, (W,)."""
    return np.array([1.0 - math.exp(-lag * time_step_s) for lag in lags.tolist()])


def lagged(
    targets: FloatArray, blend: FloatArray, *, before: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the speeds that follow their targets by first-order lags.

    Args:
        targets: (S, W) at each step.
        blend: (W,) see `blends`.
        before: (W,) the speeds before the first step.

    Returns:
        The speeds, (S, W), and the last of them, (W,).
    """
    if not (targets.any() or before.any()):
        return np.zeros_like(targets), before
    if targets.size <= _FEW:
        return _lagged_few(targets, blend, before)
    speeds = np.zeros_like(targets)
    current = before
    for k, target in enumerate(targets):
        current = current + blend * (target - current)
        speeds[k] = current
    return speeds, current


def _lagged_few(
    targets: FloatArray, blend: FloatArray, before: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return speeds that follow their targets, in plain numbers, faster for a few of them."""
    speeds = targets.copy()
    followed: dict[tuple[float, ...], FloatArray] = {}
    columns = zip(targets.T.tolist(), blend.tolist(), before.tolist(), strict=True)
    for number, (goal, share, speed) in enumerate(columns):
        # The wheels of one side are alike.
        key = (share, speed, *goal)
        column = followed.get(key)
        if column is None:
            now, reached = speed, []
            for target in goal:
                now += share * (target - now)
                reached.append(now)
            column = followed[key] = np.array(reached)
        speeds[:, number] = column
    return speeds, speeds[-1]
