"""What the keys make of a joint's drive: its target at every step."""

import math

import numpy as np

from buildarena_geometry.modules.joints import Drive
from buildarena_simulation.structure.model import BoolArray, FloatArray


def speed_targets(
    drive: Drive, forward: BoolArray, backward: BoolArray, *, sign: float, time_step_s: float
) -> FloatArray:
    """Speeds that a drive aims at, (S,), rad/s or units/s; NaN where it turns freely.

    Args:
        drive: A drive for a speed.
        forward: (S,) whether a key for forward is held at each step.
        backward: (S,) whether one for backward is.
        sign: Which way forward is along the joint's axis.
        time_step_s: Length of a step, seconds.
    """
    if drive.default_mode == "forward":
        forward = np.ones_like(forward)
    wanted = sign * drive.rate * (forward.astype(np.float64) - backward)
    speeds = lagged(wanted[:, None], np.array([drive.lag_per_s]), time_step_s)[:, 0]
    if drive.default_mode == "free":
        speeds[~forward & ~backward] = np.nan
    return speeds


def place_targets(
    drive: Drive,
    forward: BoolArray,
    backward: BoolArray,
    *,
    sign: float,
    limits: tuple[float, float] | None,
    time_step_s: float,
) -> FloatArray:
    """Places that a drive aims at, (S,), rad or units: its keys move them at its rate.

    Args:
        drive: A drive for a place.
        forward: (S,) whether a key for forward is held at each step.
        backward: (S,) whether one for backward is.
        sign: Which way forward is along the joint's axis.
        limits: The smallest and largest place; None without.
        time_step_s: Length of a step, seconds.
    """
    low, high = limits or (-math.inf, math.inf)
    move = sign * drive.rate * time_step_s * (forward.astype(np.float64) - backward)
    back = drive.rate * time_step_s if drive.default_mode == "return" else 0.0
    targets = np.zeros(len(move))
    if not (forward.any() or backward.any()):
        return targets
    place = 0.0
    for k, (step, pressed) in enumerate(
        zip(move.tolist(), (forward | backward).tolist(), strict=True)
    ):
        if pressed:
            place = min(max(place + step, low), high)
        elif back:
            place -= min(max(place, -back), back)
        targets[k] = place
    return targets


def lagged(targets: FloatArray, lags: FloatArray, time_step_s: float) -> FloatArray:
    """Speeds that follow their targets, (S, W), by first-order lags of the rates (W,), 1/s."""
    blend = np.array([1.0 - math.exp(-lag * time_step_s) for lag in lags])
    speeds = np.zeros_like(targets)
    if not targets.any():
        return speeds
    current = np.zeros(targets.shape[1])
    for k, target in enumerate(targets):
        current = current + blend * (target - current)
        speeds[k] = current
    return speeds
