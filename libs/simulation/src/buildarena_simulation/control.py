"""Effects of the keys on a machine: targets of its drives, firing cannons, heated cannons."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

import numpy as np

from buildarena_geometry.blocks import KeyPress
from buildarena_geometry.flames import flames_touch
from buildarena_geometry.modules.joints import Drive, MovingJoint
from buildarena_simulation.constants import GRAVITY, KEY_DELAY_S
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.drives import blends, lagged, place_targets, speed_targets
from buildarena_simulation.structure.model import BoolArray, FloatArray, Structure

PRESSES: Final = "presses"
"""Key of the trial's key presses in a trajectory's settings; see `written_presses`."""
SEED: Final = "seed"
"""Key of the trial's seed; absent for an exact trial."""


class KeyHold(Protocol):
    """A key held for some time; `buildarena_geometry.KeyPress` is one."""

    @property
    def time_s(self) -> float:
        """Time of the press, seconds."""

    @property
    def key(self) -> str:
        """Key that is pressed."""

    @property
    def hold_for_s(self) -> float:
        """Duration of the press, seconds."""


def varied_presses(
    keys: Sequence[KeyHold], control: Control, seed: int
) -> tuple[Sequence[KeyHold], Control]:
    """Delay each press and release a little, as a person or a runner does.

    Args:
        control: Held cannons start late too.
        seed: Seed of the delays, each up to `KEY_DELAY_S`.
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
    """Cut the presses at the time at which the scenario releases every key, if there is one.

    Args:
        control: Control with the time of the release.
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
"""Keys bound to each action of each block."""


def channel(block_id: str, action: str) -> str:
    """Return a controller's name for an action of one block."""
    return f"{block_id}.{action}"


Levels = Callable[[int, str], FloatArray]
"""Level of an action of a part at each of S steps, 0 to 1, (S,).

Parts are counted as in `bindings_of`: the blocks, then the springs.
"""


class Steady:
    """Levels that are constant over some steps; see `Levels`.

    Args:
        levels: Commands by part and action, 0 to 1; others are 0.
        count: Number of steps.
    """

    def __init__(self, levels: Mapping[tuple[int, str], float], count: int) -> None:
        self._levels, self._count = levels, count

    def __call__(self, part: int, action: str) -> FloatArray:
        """Return the level at each step, (S,)."""
        return np.full(self._count, self.share(part, action))

    def share(self, part: int, action: str) -> float:
        """Return the level at all steps."""
        return self._levels.get((part, action), 0.0)


def key_levels(bindings: Bindings, keys: Sequence[KeyHold], times: FloatArray) -> Levels:
    """Return the levels of the keys: 1 while one of an action's keys is held.

    Args:
        bindings: The keys of each part's actions; parts beyond them have none.
        times: (S,) beginning of each step, seconds.
    """

    def level(part: int, action: str) -> FloatArray:
        bound = bindings[part].get(action, ()) if part < len(bindings) else ()
        return held_during(keys, bound, times).astype(np.float64)

    return level


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Commands of some steps, one row each.

    Attributes:
        targets: (S, D) target of each driven joint (`Joints.driven`): for a wheel its speed about
            its outward axis, rad/s; for another the set point of its drive, rad, rad/s, units or
            units/s, NaN where it is free.
        firing: (S, C) command to each cannon, 0 to 1.
    """

    targets: FloatArray
    firing: FloatArray


class Drives:
    """Drives of a machine's joints, with their present targets; D driven joints.

    Args:
        time_step_s: Length of a step, seconds.
    """

    def __init__(self, structure: Structure, time_step_s: float) -> None:
        driven = structure.joints.driven
        self._time_step_s = time_step_s
        self._wheels = list(_motors(structure))
        self._driven = list(_drives(structure))
        lags = np.zeros(len(driven))
        for wheel in self._wheels:
            lags[wheel.column] = wheel.lag_per_s
        self._blend = blends(lags, time_step_s)
        # What follows a wheel's, or a drive's, wanted speed, and where a drive for a place aims.
        self._speeds, self._places = np.zeros(len(driven)), np.zeros(len(driven))

    def targets(self, levels: Levels, step_count: int) -> FloatArray:
        """Return the targets of the next steps, (S, D), as in `Schedule.targets`.

        A driven wheel's target follows its commands with a first-order lag; without a command, or
        with equal ones in both directions, it brakes.
        """
        speeds, before = np.zeros((step_count, len(self._speeds))), self._speeds
        asked: Callable[[int, str], FloatArray | float]
        asked = levels.share if isinstance(levels, Steady) else levels
        for wheel in self._wheels:
            way = asked(wheel.part, wheel.forward) - asked(wheel.part, wheel.backward)
            speeds[:, wheel.column] = wheel.speed * way
        targets, self._speeds = lagged(speeds, self._blend, before=before)
        none = np.zeros(step_count)
        for d, part, sign, joint, drive in self._driven:
            forward = none if drive.forward is None else levels(part, drive.forward)
            backward = none if drive.backward is None else levels(part, drive.backward)
            if drive.kind == "speed":
                targets[:, d], self._speeds[d] = speed_targets(
                    drive,
                    forward,
                    backward,
                    sign=sign,
                    time_step_s=self._time_step_s,
                    before=before[d],
                )
                continue
            targets[:, d] = place_targets(
                drive,
                forward,
                backward,
                sign=sign,
                limits=joint.limits,
                time_step_s=self._time_step_s,
                place=self._places[d],
            )
            self._places[d] = targets[-1, d]
        return targets


class _Motor(NamedTuple):
    """A driven wheel: its column in targets, its part, its actions, speed forward and lag."""

    column: int
    part: int
    forward: str
    backward: str
    speed: float
    lag_per_s: float


def _motors(structure: Structure) -> Iterator[_Motor]:
    for w, block in enumerate(structure.wheels.tolist()):
        part, motor = structure.parts[block], structure.parts[block].module.motor
        if motor is not None:
            # Clockwise seen from outside is against the outward axis.
            speed = (-1.0 if part.forward_is_clockwise else 1.0) * motor.speed
            yield _Motor(w, block, motor.forward, motor.backward, speed, motor.lag_per_s)


def _drives(structure: Structure) -> Iterator[tuple[int, int, float, MovingJoint, Drive]]:
    """Yield each drive: its column in targets, its part, the sign of forward, its joint, itself."""
    for d, block in enumerate(structure.joints.driven.tolist()):
        part, joint = structure.parts[block], structure.parts[block].module.joint
        if joint is not None and joint.drive is not None:
            yield d, block, -1.0 if part.forward_is_clockwise else 1.0, joint, joint.drive


def held_during(keys: Sequence[KeyHold], names: Sequence[str], times: FloatArray) -> BoolArray:
    """Return true for each time, (S,), at which one of some keys is held.

    Args:
        names: Keys to look for.
        times: (S,) seconds.
    """
    result = np.zeros(len(times), dtype=bool)
    for key in keys:
        if key.key in names:
            start, end = key.time_s - 1e-9, key.time_s + key.hold_for_s - 1e-9
            result |= (times >= start) & (times < end)
    return result


def plan_schedule(
    structure: Structure, levels: Levels, drives: Drives, *, control: Control, times: FloatArray
) -> Schedule:
    """Plan the commands of some steps.

    Args:
        levels: Commands from keys or a program.
        drives: Drives with their present targets, which are advanced.
        times: (S,) beginning of each step, seconds.
    """
    targets = drives.targets(levels, len(times))
    firing = np.zeros((len(times), len(structure.cannons)))
    if control.mode == "constant":
        firing[times >= control.from_s - 1e-9] = 1.0
        return Schedule(targets=targets, firing=firing)
    for c, block in enumerate(structure.cannons):
        thrust = structure.parts[block].module.thrust
        if thrust is not None:
            firing[:, c] = levels(int(block), thrust.action)
    return Schedule(targets=targets, firing=firing)


def reaching(bindings: Bindings, keys: Sequence[KeyHold]) -> list[KeyHold]:
    """Return the key presses that are bound to some block's action.

    Args:
        bindings: (N,) keys of each block's actions.
        keys: Control sequence as played.
    """
    bound = {key for actions in bindings for names in actions.values() for key in names}
    return [key for key in keys if key.key in bound]


def written_presses(presses: Sequence[KeyHold]) -> str:
    """Format the key presses that reach some block's action for a trajectory's settings."""
    rows = [[press.key, press.time_s, press.hold_for_s] for press in presses]
    return json.dumps(rows, separators=(",", ":"))


def read_presses(text: str) -> tuple[KeyPress, ...]:
    """Parse the key presses that `written_presses` wrote."""
    return tuple(
        KeyPress(key=key, time_s=time_s, hold_for_s=hold_for_s)
        for key, time_s, hold_for_s in json.loads(text)
    )


def released_at(presses: Sequence[KeyHold]) -> float:
    """Return the time from which none of the keys is held, seconds."""
    return max((press.time_s + press.hold_for_s for press in presses), default=0.0)


def heated_cannons(structure: Structure, shown: FloatArray, directions: FloatArray) -> BoolArray:
    """Return true for each cannon that a flame touches, (C,).

    A cannon's body is spheres in a row, so it is narrower between them; a flame heats it if it
    touches one of them.

    Args:
        shown: (N, 3) centres of the blocks, world frame, units.
        directions: (N, 3) pointing directions of cannons and torches, world frame.
    """
    flames, bodies = structure.flames, structure.heat_bodies
    if not len(bodies) or not len(flames):
        return np.zeros(len(structure.cannons), dtype=bool)
    fires, targets = flames.centers(shown, directions), bodies.centers(shown, directions)
    touched = flames_touch(targets, bodies.radius, fires, flames.radius).any(axis=1)
    heated = np.zeros(len(structure), dtype=bool)
    heated[bodies.block[touched]] = True
    return np.asarray(heated[structure.cannons])


def recoil(structure: Structure, firing: FloatArray, heated: BoolArray) -> FloatArray:
    """Return the recoil of each cannon, (C,), mass·unit/s².

    Args:
        firing: (C,) command to each cannon, 0 to 1.
        heated: (C,) true for each that a flame touches.
    """
    thrusts = np.where(heated, structure.heated_thrusts, structure.cold_thrusts)
    return np.asarray(thrusts * firing * GRAVITY)
