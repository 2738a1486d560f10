"""What pushes everything sideways: gusts, whose seed says when they blow where, and pushes."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from buildarena_simulation.scenario import Gusts, Push, Scenario
from buildarena_simulation.structure.model import FloatArray

PUSH_S: Final = 0.2
"""How long a push lasts, seconds: a whole number of the intervals in which engines step."""
_WAVES = 5
"""How many each axis has."""
_SLOWEST = 4.0
"""Period of the slowest, as a multiple of the quickest one's."""


class Wind:
    """The wind of one trial.

    Each of two axes has waves of one size, whose periods and phases are drawn. Both together never
    exceed the strength.

    Args:
        gusts: How strong and how quick it is.
        seed: Draws it.
    """

    def __init__(self, gusts: Gusts, seed: int) -> None:
        draw = np.random.default_rng([seed, 3])
        shares = draw.uniform(size=(2, _WAVES))
        self._rates = 2 * np.pi / (gusts.shortest_s * _SLOWEST**shares)
        self._phases = draw.uniform(0.0, 2 * np.pi, size=(2, _WAVES))
        self._size = gusts.strength / (np.sqrt(2.0) * _WAVES)

    def at(self, time_s: float) -> FloatArray:
        """What it accelerates everything by, (3,), world frame, units/s²."""
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
        """What it accelerates everything by, (3,), world frame, units/s²."""
        blown = pushed(self._pushes, time_s)
        return blown if self._wind is None else blown + self._wind.at(time_s)


def pushed(pushes: Sequence[Push], time_s: float) -> FloatArray:
    """What pushes accelerate everything by at a time, (3,), world frame, units/s²."""
    now = [push.velocity for push in pushes if push.at_s <= time_s < push.at_s + PUSH_S]
    return np.array([*np.sum(now, axis=0), 0.0]) / PUSH_S if now else np.zeros(3)
