"""Support forces on the cargo and on the machine over the last moments."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.components import Mask, masses_of
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

_HALF_A_SECOND: Final = 12
"""Samples over which forces are averaged: what hops is carried all the same."""

_ON_GROUND: Final = 0.9
"""Smallest share of a machine's weight that the ground carries while it is on the ground."""

_TOUCH: Final = 0.02
"""Largest share of a machine's weight that the ground carries while it is in the air."""

Series = NDArray[np.float64]


def bears_cargo(
    trajectory: "Trajectory", *, share: float = 0.5, samples: int = _HALF_A_SECOND
) -> Mask:
    """Return when the machine carries a share of the cargo's weight, over some samples, (T,).

    A cargo that hops on its deck is carried; one that was thrown, or lies on the ground, is not.

    Args:
        trajectory: A trial with a cargo and with forces.
        share: Smallest share of the weight.
        samples: Number of last samples that are averaged.
    """
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    assert trajectory.cargo_mass is not None  # noqa: S101
    load = _moving_sum(trajectory.bearing.cargo, samples)
    return np.asarray(load >= share * _moving_sum(trajectory.cargo_mass, samples))


def rests(
    machine: "Machine", trajectory: "Trajectory", joined: Mask, *, share: float = _ON_GROUND
) -> Mask:
    """Return when ground and terrain support the machine and what it carries, (T,).

    Args:
        trajectory: A trial with forces.
        joined: (T, N) as `joined_to_start` returns.
        share: Smallest share of the weight.
    """
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    weight = masses_of(machine, trajectory, joined) + trajectory.bearing.cargo
    support = _moving_sum(from_below(trajectory), _HALF_A_SECOND)
    return np.asarray(support >= share * _moving_sum(weight, _HALF_A_SECOND))


def is_airborne(machine: "Machine", trajectory: "Trajectory", joined: Mask) -> Mask:
    """Return when nothing joined to the starting block touches ground or terrain, (T,).

    What came off may lie on the ground, by its own weight.
    """
    total = masses_of(machine, trajectory, np.ones_like(joined))
    allowed = total - masses_of(machine, trajectory, joined) + _TOUCH * total
    # A grip that holds on to the ground pulls at it.
    support = _moving_sum(np.abs(from_below(trajectory)), _HALF_A_SECOND)
    return np.asarray(support <= _moving_sum(allowed, _HALF_A_SECOND))


def touches_from_below(machine: "Machine", trajectory: "Trajectory", joined: Mask) -> Mask:
    """Return when ground or terrain supports what is joined to the starting block, (T,).

    Any force counts that is more than a small share of its weight, and more than the weight of
    what came off, which may lie there.
    """
    total = masses_of(machine, trajectory, np.ones_like(joined))
    own = masses_of(machine, trajectory, joined)
    return np.asarray(from_below(trajectory) > total - own + _TOUCH * own)


def from_below(trajectory: "Trajectory") -> Series:
    """Return the vertical force of ground and terrain on the machine, (T,), mass·g."""
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    bearing = trajectory.bearing
    return np.asarray(bearing.ground.astype(np.float64) + bearing.terrain.sum(axis=1))


def _moving_sum(series: NDArray[np.floating], samples: int) -> Series:
    """Return the sum over the last samples, each included, (T,)."""
    sums = np.cumsum(series.astype(np.float64))
    sums[samples:] -= sums[:-samples].copy()
    return np.asarray(sums)
