"""Support forces on the cargo and on the machine over the last moments."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.masses import joined_masses, whole_mass
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series

_HALF_A_SECOND: Final = 12
"""Samples over which forces are averaged: what hops is carried all the same."""

_ON_GROUND: Final = 0.9
"""Smallest share of a machine's weight that the ground carries while it is on the ground."""

_TOUCH: Final = 0.02
"""Largest share of a machine's weight that the ground carries while it is in the air."""


def bears_cargo(run: Run, *, share: float = 0.5, samples: int = _HALF_A_SECOND) -> Mask:
    """Return when the machine carries a share of the cargo's weight, over some samples, (T,).

    A cargo that hops on its deck is carried; one that was thrown, or lies on the ground, is not.

    Args:
        run: Has a cargo, and forces.
        share: Smallest share of the weight.
        samples: Number of last samples that are averaged.
    """
    load = _moving_sum(run.bearing.cargo, samples)
    return np.asarray(load >= share * _moving_sum(run.cargo_mass, samples))


def rests(run: Run, *, share: float = _ON_GROUND) -> Mask:
    """Return when ground and terrain support the machine and what it carries, (T,).

    Args:
        run: Has forces.
        share: Smallest share of the weight.
    """
    weight = joined_masses(run) + run.bearing.cargo
    support = _moving_sum(from_below(run), _HALF_A_SECOND)
    return np.asarray(support >= share * _moving_sum(weight, _HALF_A_SECOND))


def is_airborne(run: Run) -> Mask:
    """Return when nothing joined to the starting block touches ground or terrain, (T,).

    What came off may lie on the ground, by its own weight.
    """
    total = whole_mass(run)
    allowed = total - joined_masses(run) + _TOUCH * total
    # A grip that holds on to the ground pulls at it.
    support = _moving_sum(np.abs(from_below(run)), _HALF_A_SECOND)
    return np.asarray(support <= _moving_sum(allowed, _HALF_A_SECOND))


def touches_from_below(run: Run) -> Mask:
    """Return when ground or terrain supports what is joined to the starting block, (T,).

    Any force counts that is more than a small share of its weight, and more than the weight of
    what came off, which may lie there.
    """
    total = whole_mass(run)
    own = joined_masses(run)
    return np.asarray(from_below(run) > total - own + _TOUCH * own)


def from_below(run: Run) -> Series:
    """Return the vertical force of ground and terrain on the machine, (T,), mass·g."""
    return np.asarray(run.bearing.ground.astype(np.float64) + run.bearing.terrain.sum(axis=1))


def _moving_sum(series: NDArray[np.floating], samples: int) -> Series:
    """Return the sum over the last samples, each included, (T,)."""
    sums = np.cumsum(series.astype(np.float64))
    sums[samples:] -= sums[:-samples].copy()
    return np.asarray(sums)
