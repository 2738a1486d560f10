"""What the keys make of a machine: targets of its drives, firing cannons, heated cannons."""

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
"""Where a trajectory's settings keep the key presses of the trial; see `written_presses`."""
SEED: Final = "seed"
"""Where they keep the seed of the trial; they have none of an exact one."""


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


def channel(block_id: str, action: str) -> str:
    """What an action of one block is called where a controller asks for it."""
    return f"{block_id}.{action}"


Levels = Callable[[int, str], FloatArray]
"""How far an action of a part is asked for at each of S steps, 0 to 1, (S,).

Parts are counted as in `bindings_of`: the blocks, then the springs.
"""


class Steady:
    """Levels that are the same at all of some steps; see `Levels`.

    Args:
        levels: What is asked for, 0 to 1; the rest is not.
        count: How many steps.
    """

    def __init__(self, levels: Mapping[tuple[int, str], float], count: int) -> None:
        self._levels, self._count = levels, count

    def __call__(self, part: int, action: str) -> FloatArray:
        """The level at each step, (S,)."""
        return np.full(self._count, self.share(part, action))

    def share(self, part: int, action: str) -> float:
        """The level at all steps."""
        return self._levels.get((part, action), 0.0)


def key_levels(bindings: Bindings, keys: Sequence[KeyHold], times: FloatArray) -> Levels:
    """What keys ask for: 1 while one of an action's keys is held.

    Args:
        bindings: The keys of each part's actions; parts beyond them have none.
        keys: The control sequence.
        times: (S,) when the steps begin, seconds.
    """

    def level(part: int, action: str) -> FloatArray:
        bound = bindings[part].get(action, ()) if part < len(bindings) else ()
        return held_during(keys, bound, times).astype(np.float64)

    return level


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Commands of some steps, one row each.

    Attributes:
        targets: (S, D) target of each driven joint (`Joints.driven`): of a wheel its speed about
            its outward axis, rad/s; of another what its drive holds, rad, rad/s, units or units/s,
            NaN where it is free.
        firing: (S, C) how far each cannon is asked to fire, 0 to 1.
    """

    targets: FloatArray
    firing: FloatArray


class Drives:
    """The drives of a machine's joints and what they have come to; D driven joints.

    Args:
        structure: The machine.
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
        """The targets of the next steps, (S, D), as in `Schedule.targets`.

        A driven wheel's follows what is asked for by a first-order lag; where nothing is, or both
        directions alike, it brakes.
        """
        wanted, before = np.zeros((step_count, len(self._speeds))), self._speeds
        asked: Callable[[int, str], FloatArray | float]
        asked = levels.share if isinstance(levels, Steady) else levels
        for wheel in self._wheels:
            way = asked(wheel.part, wheel.forward) - asked(wheel.part, wheel.backward)
            wanted[:, wheel.column] = wheel.speed * way
        targets, self._speeds = lagged(wanted, self._blend, before=before)
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
    """Of each drive: its column in targets, its part, the sign of forward, its joint, itself."""
    for d, block in enumerate(structure.joints.driven.tolist()):
        part, joint = structure.parts[block], structure.parts[block].module.joint
        if joint is not None and joint.drive is not None:
            yield d, block, -1.0 if part.forward_is_clockwise else 1.0, joint, joint.drive


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
    structure: Structure, levels: Levels, drives: Drives, *, control: Control, times: FloatArray
) -> Schedule:
    """The commands of some steps.

    Args:
        structure: The machine.
        levels: What is asked for.
        drives: What the drives have come to before; they go on from it.
        control: Who presses the keys.
        times: (S,) when each step begins, seconds.
    """
    targets = drives.targets(levels, len(times))
    firing = np.zeros((len(times), len(structure.cannons)))
    if control.mode == "held":
        firing[times >= control.from_s - 1e-9] = 1.0
        return Schedule(targets=targets, firing=firing)
    for c, block in enumerate(structure.cannons):
        thrust = structure.parts[block].module.thrust
        if thrust is not None:
            firing[:, c] = levels(int(block), thrust.action)
    return Schedule(targets=targets, firing=firing)


def reaching(bindings: Bindings, keys: Sequence[KeyHold]) -> list[KeyHold]:
    """The key presses that reach some block's action.

    Args:
        bindings: (N,) the keys of each block's actions.
        keys: The control sequence as it was played.
    """
    bound = {key for actions in bindings for names in actions.values() for key in names}
    return [key for key in keys if key.key in bound]


def written_presses(presses: Sequence[KeyHold]) -> str:
    """Key presses as a trajectory's settings keep them: those that reach something."""
    rows = [[press.key, press.time_s, press.hold_for_s] for press in presses]
    return json.dumps(rows, separators=(",", ":"))


def read_presses(text: str) -> tuple[KeyPress, ...]:
    """The key presses that `written_presses` wrote."""
    return tuple(
        KeyPress(key=key, time_s=time_s, hold_for_s=hold_for_s)
        for key, time_s, hold_for_s in json.loads(text)
    )


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


def recoil(structure: Structure, firing: FloatArray, heated: BoolArray) -> FloatArray:
    """Recoil of each cannon, (C,), mass·unit/s².

    Args:
        structure: The machine.
        firing: (C,) how far each cannon is asked to fire, 0 to 1.
        heated: (C,) whether a flame touches it.
    """
    thrusts = np.where(heated, structure.heated_thrusts, structure.cold_thrusts)
    return np.asarray(thrusts * firing * GRAVITY)
