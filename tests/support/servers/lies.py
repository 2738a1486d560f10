"""Lies: what a hostile runner may say of a trial that it ran, or that it never ran."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from buildarena_simulation import Trajectory
from buildarena_simulation.trajectory import Break

Lie = Callable[[Trajectory], Trajectory]


def _changed(array: Any, change: Callable[[Any], object]) -> Any:
    made = array.copy()
    change(made)
    return made


def _held(t: Trajectory) -> Trajectory:
    """Everything stays where it was at an instant."""
    names = ("positions", "quaternions", "cargo_position", "cargo_quaternion")
    told = {name: array for name in names if (array := getattr(t, name)) is not None}
    since = np.minimum(np.arange(len(t.time_s)), 5)
    return replace(t, **{name: array[since] for name, array in told.items()})


def _moved(axis: int, by: float, *, of: str) -> Lie:
    """Blocks or cargo elsewhere, a little further at each instant."""

    def lie(t: Trajectory) -> Trajectory:
        def move(a: Any) -> None:
            steps = np.linspace(0, by, len(a), dtype=np.float32)[1:]
            a[1:, ..., axis] += steps.reshape(-1, *[1] * (a.ndim - 2))

        return replace(t, **{of: _changed(getattr(t, of), move)})

    return lie


def _broken(t: Trajectory) -> Trajectory:
    """A joint breaks that holds."""
    peak = t.joint_peaks[0]
    mass = None if t.cargo_mass is None else float(t.cargo_mass[-1])
    event = Break(time_s=0.3, joint=peak.joint, kind=peak.kind, ratio=1.1, cargo_mass=mass)
    return replace(t, breaks=(event,))


def _last_bit(t: Trajectory) -> Trajectory:
    def nudge(places: Any) -> None:
        places[-1, 0, 2] = np.nextafter(places[-1, 0, 2], np.float32(9))

    return replace(t, positions=_changed(t.positions, nudge))


LIES: dict[str, Lie] = {
    "poses held from instant 5": _held,
    "blocks +0.01 along x": _moved(0, 0.01, of="positions"),
    "blocks +50 along z": _moved(2, 50.0, of="positions"),
    "cargo +0.01 along x": _moved(0, 0.01, of="cargo_position"),
    "no ground": lambda t: replace(t, bearing=replace(t.bearing, ground=t.bearing.ground * 0)),
    "joints without loads": lambda t: replace(t, joint_loads=t.joint_loads * np.float32(0)),
    "a break at 0.3 s": _broken,
    "the last bit of one pose": _last_bit,
    "another step": lambda t: replace(t, settings={**t.settings, "substeps": 1}),
    "a version of the engine that it has not": lambda t: replace(t, engine_version="0.0.1"),
}
"""Ways to lie in a trajectory, by name; of a trial with cargo and joints."""
