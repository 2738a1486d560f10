"""What the keys make of a machine: wheel speeds, firing cannons, heated cannons."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from buildarena_simulation.constants import (
    CANNON_BULB_OFFSETS,
    CANNON_BULB_RADIUS,
    COLD_THRUST,
    FLAME_DISTANCE,
    FLAME_RADIUS,
    GRAVITY,
    HEATED_THRUST,
    WHEEL_LAG_RATE,
    WHEEL_SPEED,
)
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.model import BoolArray, FloatArray, Structure


class KeyHold(Protocol):
    """A key held for some time; `buildarena_geometry.KeyPress` is one."""

    @property
    def time_s(self) -> float:
        """When it is pressed, seconds."""

    @property
    def key(self) -> str:
        """Which key."""

    @property
    def hold_for_s(self) -> float:
        """For how long, seconds."""


Bindings = Sequence[Mapping[str, Sequence[str]]]
"""Per block: the keys bound to each of its actions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Commands of a whole trial, one row per engine step.

    Attributes:
        wheel_speeds: (S, W) target of each wheel, rad/s about its outward axis.
        firing: (S, C) whether each cannon's key is held.
    """

    wheel_speeds: FloatArray
    firing: BoolArray


def plan_schedule(
    structure: Structure,
    bindings: Bindings,
    keys: Sequence[KeyHold],
    *,
    control: Control,
    step_count: int,
    time_step_s: float,
) -> Schedule:
    """The commands a control sequence gives.

    A driven wheel's target follows its key by a first-order lag; without a key, or with keys for
    both directions, it brakes.

    Args:
        structure: The machine.
        bindings: (N,) the keys of each block's actions.
        keys: The control sequence; read in mode "agent" only.
        control: Who presses the keys.
        step_count: Number of engine steps in the trial.
        time_step_s: Length of one, seconds.
    """
    times = np.arange(step_count) * time_step_s
    if control.mode == "held":
        firing = np.repeat(
            (times >= control.from_s - 1e-9)[:, None], len(structure.cannons), axis=1
        )
        return Schedule(wheel_speeds=np.zeros((step_count, len(structure.wheels))), firing=firing)
    pressed = keys if control.mode == "agent" else ()

    def held(block: int, action: str) -> BoolArray:
        wanted = set(bindings[block].get(action, ()))
        result = np.zeros(step_count, dtype=bool)
        for key in pressed:
            if key.key in wanted:
                start, end = key.time_s - 1e-9, key.time_s + key.hold_for_s - 1e-9
                result |= (times >= start) & (times < end)
        return result

    wheel_speeds = np.zeros((step_count, len(structure.wheels)))
    for w, block in enumerate(structure.wheels):
        forward = held(block, "spinning_forward").astype(np.float64)
        backward = held(block, "spinning_backward").astype(np.float64)
        # An unflipped wheel rolls forward turning clockwise seen along its outward axis.
        sign = 1.0 if structure.parts[block].flipped else -1.0
        wheel_speeds[:, w] = sign * WHEEL_SPEED * (forward - backward)
    firing = np.zeros((step_count, len(structure.cannons)), dtype=bool)
    for c, block in enumerate(structure.cannons):
        firing[:, c] = held(block, "hold_to_fire")
    return Schedule(wheel_speeds=_lagged(wheel_speeds, time_step_s), firing=firing)


def effective_presses(bindings: Bindings, keys: Sequence[KeyHold]) -> int:
    """How many of the key presses reach some block's action.

    Args:
        bindings: (N,) the keys of each block's actions.
        keys: The control sequence.
    """
    bound = {key for actions in bindings for names in actions.values() for key in names}
    return sum(key.key in bound for key in keys)


def heated_cannons(structure: Structure, shown: FloatArray, directions: FloatArray) -> BoolArray:
    """Which cannons a flame touches, (C,).

    A cannon's body is two spheres in a row, so it is narrower in the middle; a flame heats it if
    the two bodies touch: its centre lies within the flame's radius of either sphere's surface.

    Args:
        structure: The machine.
        shown: (N, 3) centres of the blocks, world frame, units.
        directions: (N, 3) where cannons spray and torches flame, world frame.
    """
    cannons, torches = structure.cannons, structure.torches
    if not len(cannons) or not len(torches):
        return np.zeros(len(cannons), dtype=bool)
    flames = shown[torches] + FLAME_DISTANCE * directions[torches]
    heated = np.zeros(len(cannons), dtype=bool)
    for offset in CANNON_BULB_OFFSETS:
        bulbs = shown[cannons] + offset * directions[cannons]
        distance = np.linalg.norm(bulbs[:, None] - flames[None], axis=2) - CANNON_BULB_RADIUS
        heated |= (distance <= FLAME_RADIUS + 1e-9).any(axis=1)
    return heated


def recoil(firing: BoolArray, heated: BoolArray) -> FloatArray:
    """Recoil of each cannon, (C,), mass·unit/s²."""
    return np.asarray(np.where(heated, HEATED_THRUST, COLD_THRUST) * firing * GRAVITY)


def _lagged(targets: FloatArray, time_step_s: float) -> FloatArray:
    blend = 1.0 - math.exp(-WHEEL_LAG_RATE * time_step_s)
    speeds = np.zeros_like(targets)
    if not targets.any():
        return speeds
    current = np.zeros(targets.shape[1])
    for k, target in enumerate(targets):
        current = current + blend * (target - current)
        speeds[k] = current
    return speeds
