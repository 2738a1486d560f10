"""Support forces on the cargo and on the machine over the last moments."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.components import Mask, masses_of
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

_HALF_A_SECOND: Final = 12
"""Samples over which forces are judged: what hops is borne all the same."""

_ON_GROUND: Final = 0.9
"""Smallest share of the weight that the ground bears of a machine that stands on it."""

_TOUCH: Final = 0.02
"""Largest share of its weight that the ground bears of a machine that is in the air."""

Series = NDArray[np.float64]


def bears_cargo(
    trajectory: "Trajectory", *, share: float = 0.5, samples: int = _HALF_A_SECOND
) -> Mask:
    """At which samples the machine bears a share of the cargo's weight, over some samples, (T,).

    A cargo that hops on its deck is borne; one that was thrown, or lies on the ground, is not.

    Args:
        trajectory: A trial with a cargo and with forces.
        share: Smallest share of the weight.
        samples: Over how many of the last samples.
    """
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    assert trajectory.cargo_mass is not None  # noqa: S101
    load = _summed(trajectory.bearing.cargo, samples)
    return np.asarray(load >= share * _summed(trajectory.cargo_mass, samples))


def stands(
    machine: "Machine", trajectory: "Trajectory", joined: Mask, *, share: float = _ON_GROUND
) -> Mask:
    """At which samples ground and terrain bear the machine and what it bears, (T,).

    Args:
        trajectory: A trial with forces.
        joined: (T, N) as `joined_to_start` says.
        share: Smallest share of the weight.
    """
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    weight = masses_of(machine, trajectory, joined) + trajectory.bearing.cargo
    borne = _summed(from_below(trajectory), _HALF_A_SECOND)
    return np.asarray(borne >= share * _summed(weight, _HALF_A_SECOND))


def is_airborne(machine: "Machine", trajectory: "Trajectory", joined: Mask) -> Mask:
    """At which samples nothing joined to the starting block touches ground or terrain, (T,).

    What came off may lie on the ground, by its own weight.
    """
    whole = masses_of(machine, trajectory, np.ones_like(joined))
    allowed = whole - masses_of(machine, trajectory, joined) + _TOUCH * whole
    # A grip that holds on to the ground pulls at it.
    borne = _summed(np.abs(from_below(trajectory)), _HALF_A_SECOND)
    return np.asarray(borne <= _summed(allowed, _HALF_A_SECOND))


def touches_from_below(machine: "Machine", trajectory: "Trajectory", joined: Mask) -> Mask:
    """At which samples ground or terrain bears what is joined to the starting block, (T,).

    Any force counts that is more than a small share of its weight, and more than the weight of
    what came off, which may lie there.
    """
    whole = masses_of(machine, trajectory, np.ones_like(joined))
    own = masses_of(machine, trajectory, joined)
    return np.asarray(from_below(trajectory) > whole - own + _TOUCH * own)


def from_below(trajectory: "Trajectory") -> Series:
    """Vertical force of ground and terrain on the machine, (T,), mass·g."""
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    bearing = trajectory.bearing
    return np.asarray(bearing.ground.astype(np.float64) + bearing.terrain.sum(axis=1))


def _summed(series: NDArray[np.floating], samples: int) -> Series:
    """Sum over the last samples, each included, (T,)."""
    sums = np.cumsum(series.astype(np.float64))
    sums[samples:] -= sums[:-samples].copy()
    return np.asarray(sums)
