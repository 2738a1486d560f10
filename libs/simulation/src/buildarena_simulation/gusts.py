"""Sideways accelerations of everything: seeded gusts, and pushes at set times."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from buildarena_simulation.scenario import Gusts, Push, Scenario
from buildarena_simulation.structure.model import FloatArray

PUSH_S: Final = 0.2
"""Duration of a push, seconds: an integer number of the engines' intervals."""
_WAVES = 5
"""Number of waves of each axis."""
_SLOWEST = 4.0
"""Period of the slowest, as a multiple of the quickest one's."""


class Wind:
    """The wind of one trial.

    Each of two axes has waves of one size with random periods and phases. Together they never
    exceed the strength.

    Args:
        gusts: Strength and period.
        seed: Seed of periods and phases.
    """

    def __init__(self, gusts: Gusts, seed: int) -> None:
        draw = np.random.default_rng([seed, 3])
        shares = draw.uniform(size=(2, _WAVES))
        self._rates = 2 * np.pi / (gusts.shortest_s * _SLOWEST**shares)
        self._phases = draw.uniform(0.0, 2 * np.pi, size=(2, _WAVES))
        self._size = gusts.strength / (np.sqrt(2.0) * _WAVES)

    def at(self, time_s: float) -> FloatArray:
        """Return its acceleration of everything, (3,), world frame, units/s²."""
        waves = np.sin(self._rates * time_s + self._phases).sum(axis=1)
        return np.array([*(self._size * waves), 0.0])


class Blows:
    """All that pushes everything sideways in one trial.

    Args:
        scenario: The world of the trial.
        seed: Draws the wind.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self._wind = None if scenario.gusts is None else Wind(scenario.gusts, seed)
        self._pushes = scenario.pushes

    def at(self, time_s: float) -> FloatArray:
        """Return the acceleration of everything, (3,), world frame, units/s²."""
        blown = pushed(self._pushes, time_s)
        return blown if self._wind is None else blown + self._wind.at(time_s)


def pushed(pushes: Sequence[Push], time_s: float) -> FloatArray:
    """Return the pushes' acceleration of everything at a time, (3,), world frame, units/s²."""
    now = [push.velocity for push in pushes if push.at_s <= time_s < push.at_s + PUSH_S]
    return np.array([*np.sum(now, axis=0), 0.0]) / PUSH_S if now else np.zeros(3)
