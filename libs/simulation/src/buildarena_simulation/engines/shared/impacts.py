"""Contact forces averaged over an interval at little cost.

Contacts at rest change slowly, so the interval's last step represents all quiet ones. A step with
an impact is read as well: otherwise its impulse would be missed, or counted for the whole interval.
Where the last step itself is an impact, the step before it represents the quiet ones.
"""

from collections.abc import Callable, Sequence
from operator import sub
from typing import Final

from buildarena_simulation.structure.contacts import ContactForces, mean_contacts

_IMPACT: Final = 3.0
"""Acceleration of an impact, in g: more than by falling and driving."""

_JUMP: Final = 1.0
"""Rise of the contacts' total force in a step that is an impact, in weights: a hit on a wheel
on a spring hardly moves the machine."""


class ImpactWatch:
    """Collector of the contact readings of one interval.

    Args:
        step_count: Steps in the interval.
        gravity: Downward acceleration, units/s².
        time_step_s: Length of a step, seconds.
        mass: Mass of machine and cargo, mass units.
    """

    def __init__(self, step_count: int, *, gravity: float, time_step_s: float, mass: float) -> None:
        self._count = step_count
        self._limit, self._jump = _IMPACT * gravity * time_step_s, _JUMP * gravity * mass
        self._impacts: list[ContactForces] = []
        self._ends_in_impact = False
        self._quiet: Callable[[], ContactForces] | None = None
        self._pressed = 0.0

    @property
    def struck(self) -> bool:
        """True if there was an impact."""
        return bool(self._impacts)

    def before_last(self, pressed: float, read: Callable[[], ContactForces]) -> None:
        """Record the contacts before the interval's last step.

        Args:
            pressed: Sum of their normal forces, mass·unit/s².
            read: Function that reads them, also after that step.
        """
        self._pressed = pressed
        self._quiet = None if self._ends_in_impact else read

    def is_impact(self, before: Sequence[float], now: Sequence[float]) -> bool:
        """Check if the contacts of the last step must be read because of a change of velocity.

        Args:
            before: Components of the velocity of every free body before it, units/s.
            now: The same after it.
        """
        self._ends_in_impact = max(map(abs, map(sub, now, before))) > self._limit
        return self._ends_in_impact

    def ends_in_blow(self, pressed: float) -> bool:
        """Check if the last step must be read because of its normal forces.

        Args:
            pressed: Sum of them, mass·unit/s².
        """
        if self._ends_in_impact or pressed - self._pressed <= self._jump:
            return False
        self._ends_in_impact = True
        return True

    def take(self, contacts: ContactForces) -> None:
        """Record the reading of a step that was an impact."""
        self._impacts.append(contacts)

    def mean(self, read: Callable[[], ContactForces]) -> ContactForces:
        """Return the mean over the interval; after several final impacts, quiet steps are unknown.

        Args:
            read: Function that reads the contacts of the last step.
        """
        readings = [(1.0 / self._count, contacts) for contacts in self._impacts]
        quiet = self._quiet if self._ends_in_impact else read
        if quiet is not None:
            readings.append((1.0 - len(self._impacts) / self._count, quiet()))
        return mean_contacts(readings)
