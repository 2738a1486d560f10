"""Wind that pushes everything sideways: a few waves, whose seed says when they blow where."""

import numpy as np

from buildarena_simulation.scenario import Gusts
from buildarena_simulation.structure.model import FloatArray

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
