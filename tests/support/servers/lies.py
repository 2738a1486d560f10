"""Lies: what a hostile runner may say of a trial that it ran, or that it never ran."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from buildarena_simulation import Trajectory
from buildarena_simulation.trajectory import Bearing, Break, Event

Lie = Callable[[Trajectory], Trajectory]


def _changed(array: Any, change: Callable[[Any], object]) -> Any:
    made = array.copy()
    change(made)
    return made


def _held(since: int) -> Lie:
    """Everything stays where it was at an instant."""

    def lie(t: Trajectory) -> Trajectory:
        def hold(array: Any) -> Any:
            return (
                None
                if array is None
                else _changed(array, lambda a: a.__setitem__(slice(since, None), a[since]))
            )

        return replace(
            t,
            positions=hold(t.positions),
            quaternions=hold(t.quaternions),
            cargo_position=hold(t.cargo_position),
            cargo_quaternion=hold(t.cargo_quaternion),
        )

    return lie


def _at(instants: Callable[[int], Any]) -> Lie:
    """The motion of other instants: slower, faster, backwards."""

    def lie(t: Trajectory) -> Trajectory:
        which = np.clip(instants(len(t.time_s)), 0, len(t.time_s) - 1).astype(int)

        def take(array: Any) -> Any:
            return None if array is None else array[which].copy()

        return replace(
            t,
            positions=take(t.positions),
            quaternions=take(t.quaternions),
            cargo_position=take(t.cargo_position),
            cargo_quaternion=take(t.cargo_quaternion),
        )

    return lie


def _moved(axis: int, by: float, *, of: str, since: int = 1) -> Lie:
    """Blocks or cargo elsewhere from some instant on, a little further at each."""

    def lie(t: Trajectory) -> Trajectory:
        array = getattr(t, of)

        def move(a: Any) -> None:
            steps = np.arange(1, len(a) - since + 1, dtype=np.float32) / (len(a) - since) * by
            a[since:, ..., axis] += steps.reshape(-1, *[1] * (a.ndim - 2))

        return replace(t, **{of: _changed(array, move)})

    return lie


def _borne(name: str, change: Callable[[Any], Any]) -> Lie:
    """Other forces of contacts."""

    def lie(t: Trajectory) -> Trajectory:
        bearing = t.bearing
        assert bearing is not None
        values = {field: getattr(bearing, field) for field in Bearing.__dataclass_fields__}
        values[name] = np.asarray(change(values[name]), np.float32)
        return replace(t, bearing=Bearing(**values))

    return lie


def _small_peaks(t: Trajectory) -> Trajectory:
    peaks = [replace(peak, force=peak.force / 2, ratio=peak.ratio / 2) for peak in t.joint_peaks]
    return replace(t, joint_peaks=tuple(peaks))


def _broken(time_s: float) -> Lie:
    """A joint breaks at another time, or one that holds."""

    def lie(t: Trajectory) -> Trajectory:
        peak = t.joint_peaks[0]
        mass = None if t.cargo_mass is None else float(t.cargo_mass[-1])
        broken = Break(time_s=time_s, joint=peak.joint, kind=peak.kind, ratio=1.1, cargo_mass=mass)
        return replace(t, breaks=(broken,))

    return lie


def _turned(of: str) -> Lie:
    upside_down = (0.0, 1.0, 0.0, 0.0)
    return lambda t: replace(
        t,
        **{of: _changed(getattr(t, of), lambda a: a.__setitem__(slice(1, None), upside_down))},
    )


def _last_bit(t: Trajectory) -> Trajectory:
    return replace(
        t,
        positions=_changed(
            t.positions,
            lambda a: a.__setitem__((-1, 0, 2), np.nextafter(a[-1, 0, 2], np.float32(9))),
        ),
    )


LIES: dict[str, Lie] = {
    **{f"poses held from instant {since}": _held(since) for since in (0, 5)},
    "time at half its pace": _at(lambda n: np.arange(n) // 2),
    "time backwards": _at(lambda n: np.where(np.arange(n) == 0, 0, n - np.arange(n))),
    "an instant left out": _at(lambda n: np.arange(n) + (np.arange(n) > n // 2)),
    "blocks +0.01 along x": _moved(0, 0.01, of="positions"),
    "blocks +50 along z": _moved(2, 50.0, of="positions"),
    "cargo +0.01 along x": _moved(0, 0.01, of="cargo_position"),
    "cargo -1 along z": _moved(2, -1.0, of="cargo_position"),
    "a late jump": _moved(1, 10.0, of="positions", since=15),
    "blocks turned": _turned("quaternions"),
    "a cargo turned": _turned("cargo_quaternion"),
    "no ground": _borne("ground", lambda a: a * 0),
    "a heavier load": _borne("cargo", lambda a: a * 2 + 10),
    "joints without loads": lambda t: replace(t, joint_loads=t.joint_loads * np.float32(0)),
    "small peaks": _small_peaks,
    "a break at 0.3 s": _broken(0.3),
    "a block on its own at the end": lambda t: replace(
        t, pieces=_changed(t.pieces, lambda a: a.__setitem__((-1, -1), 1))
    ),
    "a cargo that was grabbed": lambda t: replace(
        t, events=(Event(time_s=0.1, what="grabbed", joint=t.joint_peaks[0].joint, held="cargo"),)
    ),
    "the last bit of one pose": _last_bit,
    "another step": lambda t: replace(t, settings={**t.settings, "substeps": 1}),
    "a version of the engine that it has not": lambda t: replace(t, engine_version="0.0.1"),
}
"""Ways to lie in a trajectory, by name; of a trial with cargo and joints."""
