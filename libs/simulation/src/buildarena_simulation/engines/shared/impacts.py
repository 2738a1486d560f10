"""Contact forces averaged over an interval at little cost.

Contacts at rest change slowly, so the interval's last step represents all quiet ones. A step with
an impact is read as well: otherwise its impulse would be missed, or counted for the whole interval.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from buildarena_simulation.structure.contacts import ContactForces, mean_contacts
from buildarena_simulation.structure.model import FloatArray

_IMPACT: Final = 3.0
"""A change of velocity faster than this many g is an impact: more than fall and driving make."""


class ImpactWatch:
    """Collects the contact readings of one interval.

    Args:
        step_count: Steps in the interval.
        gravity: Downward acceleration, units/s².
        time_step_s: Length of a step, seconds.
    """

    def __init__(self, step_count: int, *, gravity: float, time_step_s: float) -> None:
        self._count = step_count
        self._limit = _IMPACT * gravity * time_step_s
        self._impacts: list[ContactForces] = []
        self._ends_in_impact = False

    @property
    def struck(self) -> bool:
        """Whether there was an impact."""
        return bool(self._impacts)

    def is_impact(self, change: FloatArray) -> bool:
        """Whether the step just made must be read.

        Args:
            change: (K, 3) change of velocity of every free body in it, units/s.
        """
        self._ends_in_impact = bool(np.abs(change).max() > self._limit)
        return self._ends_in_impact

    def take(self, contacts: ContactForces) -> None:
        """Keeps the reading of a step that was an impact."""
        self._impacts.append(contacts)

    def mean(self, read: Callable[[], ContactForces]) -> ContactForces:
        """The mean over the interval; if it ended in an impact, its quiet steps are unknown.

        Args:
            read: Reads the contacts of the last step.
        """
        readings = [(1.0 / self._count, contacts) for contacts in self._impacts]
        if not self._ends_in_impact:
            readings.append((1.0 - len(self._impacts) / self._count, read()))
        return mean_contacts(readings)
