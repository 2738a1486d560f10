"""Contact forces averaged over an interval at little cost.

Contacts at rest change slowly, so the interval's last step stands for all quiet ones. A step in
which something is struck is read as well: its impulse would else be missed, or counted for the
whole interval.
"""

from typing import Final

from buildarena_simulation.structure.contacts import ContactForces, mean_contacts
from buildarena_simulation.structure.model import FloatArray

_JOLT: Final = 3.0
"""A change of velocity faster than this many g is a jolt: more than fall and driving make."""


class JoltWatch:
    """Collects the contact readings of one interval.

    Args:
        step_count: Steps in the interval.
        gravity: Downward acceleration, units/s².
        time_step_s: Length of a step, seconds.
    """

    def __init__(self, step_count: int, *, gravity: float, time_step_s: float) -> None:
        self._left, self._count = step_count, step_count
        self._limit = (_JOLT * gravity * time_step_s) ** 2
        self._jolts: list[ContactForces] = []
        self._last: ContactForces | None = None
        self._jolted = False

    def wants_reading(self, change: FloatArray) -> bool:
        """Whether the step just made must be read.

        Args:
            change: (K, 3) change of velocity of every free body in it, units/s.
        """
        self._left -= 1
        self._jolted = bool((change * change).sum(axis=1).max(initial=0.0) > self._limit)
        return self._jolted or self._left == 0

    def take(self, contacts: ContactForces) -> None:
        """Keeps the reading of the step just made."""
        if self._jolted:
            self._jolts.append(contacts)
        else:
            self._last = contacts

    def mean(self) -> ContactForces:
        """The mean over the interval; if it ended in a jolt, its quiet steps are not known of."""
        readings = [(1.0 / self._count, contacts) for contacts in self._jolts]
        if self._last is not None:
            readings.append((1.0 - len(self._jolts) / self._count, self._last))
        return mean_contacts(readings)
