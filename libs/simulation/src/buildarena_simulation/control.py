"""What the keys make of a machine: targets of its drives, firing cannons, heated cannons."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, Protocol

import numpy as np

from buildarena_geometry.blocks import KeyPress
from buildarena_geometry.flames import flames_touch
from buildarena_simulation.constants import GRAVITY, KEY_DELAY_S
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.drives import lagged, place_targets, speed_targets
from buildarena_simulation.structure.model import BoolArray, FloatArray, Part, Structure

PRESSES: Final = "presses"
"""Where a trajectory's settings keep the key presses of the trial; see `written_presses`."""


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


def varied_presses(
    keys: Sequence[KeyHold], control: Control, seed: int
) -> tuple[Sequence[KeyHold], Control]:
    """The same presses, each pressed and released a little late, as by a hand or a runner.

    Args:
        keys: The control sequence.
        control: Who presses the keys; held cannons start late too.
        seed: Draws the delays, each up to `KEY_DELAY_S`.
    """
    delays = KEY_DELAY_S * np.random.default_rng([seed, 1]).random(1 + 2 * len(keys))
    holds = [
        KeyPress(
            time_s=press.time_s + early,
            key=press.key,
            hold_for_s=max(0.0, press.hold_for_s + late - early),
        )
        for press, early, late in zip(keys, delays[1::2], delays[2::2], strict=True)
    ]
    return holds, control.model_copy(update={"from_s": control.from_s + float(delays[0])})


def ended_presses(keys: Sequence[KeyHold], control: Control) -> Sequence[KeyHold]:
    """The presses, cut where the scenario releases every key; all of them if it does not.

    Args:
        keys: The control sequence.
        control: Says when.
    """
    end_s = control.until_s
    if end_s is None:
        return keys
    return [
        KeyPress(
            time_s=press.time_s,
            key=press.key,
            hold_for_s=min(press.hold_for_s, end_s - press.time_s),
        )
        for press in keys
        if press.time_s < end_s
    ]


Bindings = Sequence[Mapping[str, Sequence[str]]]
"""Per block: the keys bound to each of its actions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Commands of a whole trial, one row per engine step.

    Attributes:
        targets: (S, D) target of each driven joint (`Joints.driven`): of a wheel its speed about
            its outward axis, rad/s; of another what its drive holds, rad, rad/s, units or units/s,
            NaN where it is free.
        firing: (S, C) whether each cannon's key is held.
    """

    targets: FloatArray
    firing: BoolArray


def held_during(keys: Sequence[KeyHold], names: Sequence[str], times: FloatArray) -> BoolArray:
    """Whether one of some keys is held at each time, (S,).

    Args:
        keys: The control sequence.
        names: Which keys.
        times: (S,) seconds.
    """
    result = np.zeros(len(times), dtype=bool)
    for key in keys:
        if key.key in names:
            start, end = key.time_s - 1e-9, key.time_s + key.hold_for_s - 1e-9
            result |= (times >= start) & (times < end)
    return result


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
    times = np.asarray(np.arange(step_count) * time_step_s, dtype=np.float64)
    pressed = keys if control.mode == "agent" else ()

    def held(block: int, action: str) -> BoolArray:
        return held_during(pressed, bindings[block].get(action, ()), times)

    targets = _targets(structure, held, step_count=step_count, time_step_s=time_step_s)
    if control.mode == "held":
        firing = np.repeat(
            (times >= control.from_s - 1e-9)[:, None], len(structure.cannons), axis=1
        )
        return Schedule(targets=targets, firing=firing)
    firing = np.zeros((step_count, len(structure.cannons)), dtype=bool)
    for c, block in enumerate(structure.cannons):
        thrust = structure.parts[block].module.thrust
        if thrust is not None:
            firing[:, c] = held(block, thrust.action)
    return Schedule(targets=targets, firing=firing)


def _targets(
    structure: Structure,
    held: Callable[[int, str], BoolArray],
    *,
    step_count: int,
    time_step_s: float,
) -> FloatArray:
    """The targets of all driven joints, as in `Schedule.targets`."""
    targets = np.zeros((step_count, len(structure.joints.driven)))
    lags = np.zeros(len(structure.joints.driven))
    for w, block in enumerate(structure.wheels):
        part = structure.parts[block]
        motor = part.module.motor
        if motor is None:
            continue
        forward = held(int(block), motor.forward).astype(np.float64)
        backward = held(int(block), motor.backward).astype(np.float64)
        # Clockwise seen from outside is against the outward axis.
        sign = -1.0 if part.forward_is_clockwise else 1.0
        targets[:, w] = sign * motor.speed * (forward - backward)
        lags[w] = motor.lag_per_s
    targets = lagged(targets, lags, time_step_s)
    for d, block in enumerate(structure.joints.driven):
        driven = _driven(structure.parts[block], partial(held, int(block)), step_count, time_step_s)
        if driven is not None:
            targets[:, d] = driven
    return targets


def _driven(
    part: Part, held: Callable[[str], BoolArray], step_count: int, time_step_s: float
) -> FloatArray | None:
    """The targets of a joint's own drive, (S,); None if it has none."""
    joint = part.module.joint
    if joint is None or joint.drive is None:
        return None
    drive = joint.drive
    none = np.zeros(step_count, dtype=bool)
    forward = none if drive.forward is None else held(drive.forward)
    backward = none if drive.backward is None else held(drive.backward)
    sign = -1.0 if part.forward_is_clockwise else 1.0
    if drive.kind == "speed":
        return speed_targets(drive, forward, backward, sign=sign, time_step_s=time_step_s)
    return place_targets(
        drive, forward, backward, sign=sign, limits=joint.limits, time_step_s=time_step_s
    )


def effective_presses(bindings: Bindings, keys: Sequence[KeyHold]) -> int:
    """How many of the key presses reach some block's action.

    Args:
        bindings: (N,) the keys of each block's actions.
        keys: The control sequence.
    """
    return len(_reaching(bindings, keys))


def written_presses(bindings: Bindings, keys: Sequence[KeyHold]) -> str:
    """The key presses that reach some block's action, as a trajectory's settings keep them.

    Args:
        bindings: (N,) the keys of each block's actions.
        keys: The control sequence as it was played.
    """
    presses = [[key.key, key.time_s, key.hold_for_s] for key in _reaching(bindings, keys)]
    return json.dumps(presses, separators=(",", ":"))


def read_presses(text: str) -> tuple[KeyPress, ...]:
    """The key presses that `written_presses` wrote."""
    return tuple(
        KeyPress(key=key, time_s=time_s, hold_for_s=hold_for_s)
        for key, time_s, hold_for_s in json.loads(text)
    )


def _reaching(bindings: Bindings, keys: Sequence[KeyHold]) -> list[KeyHold]:
    bound = {key for actions in bindings for names in actions.values() for key in names}
    return [key for key in keys if key.key in bound]


def heated_cannons(structure: Structure, shown: FloatArray, directions: FloatArray) -> BoolArray:
    """Which cannons a flame touches, (C,).

    A cannon's body is spheres in a row, so it is narrower between them; a flame heats it if it
    touches one of them.

    Args:
        structure: The machine.
        shown: (N, 3) centres of the blocks, world frame, units.
        directions: (N, 3) where cannons spray and torches flame, world frame.
    """
    flames, bodies = structure.flames, structure.heat_bodies
    if not len(bodies) or not len(flames):
        return np.zeros(len(structure.cannons), dtype=bool)
    fires, targets = flames.centers(shown, directions), bodies.centers(shown, directions)
    touched = flames_touch(targets, bodies.radius, fires, flames.radius).any(axis=1)
    heated = np.zeros(len(structure), dtype=bool)
    heated[bodies.block[touched]] = True
    return np.asarray(heated[structure.cannons])


def recoil(structure: Structure, firing: BoolArray, heated: BoolArray) -> FloatArray:
    """Recoil of each cannon, (C,), mass·unit/s².

    Args:
        structure: The machine.
        firing: (C,) whether each cannon's key is held.
        heated: (C,) whether a flame touches it.
    """
    thrusts = np.where(heated, structure.heated_thrusts, structure.cold_thrusts)
    return np.asarray(thrusts * firing * GRAVITY)
