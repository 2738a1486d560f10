"""Landing of a cargo on a machine: it bounces, and the impact reaches the joints.

Engines let a box come to rest where it lands. In the game it bounces off, and the impact reaches
the machine almost at once. Both are computed here, in the same way for all engines. An engine may
need several intervals to stop a cargo; their impulses are added up.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.constants import BOUNCE_MASS, CARGO_BOUNCE, MIN_LANDING_SPEED
from buildarena_simulation.engines.base import CargoPose
from buildarena_simulation.structure.contacts import CARGO, ContactForces
from buildarena_simulation.structure.model import FloatArray

_MIN_CHANGE: Final = 0.25
"""Minimum change of velocity in one interval of a landing, units/s."""

_MIN_SHARE: Final = 0.5
"""Minimum share of the machine in the forces that stopped the cargo, for a landing on it."""

_UPWARDS: Final = 0.7
"""Share of a landing that stops a fall; a cargo that slides against a wall does not land."""

_LEFT: Final = 0.1
"""Share of its speed with which a cargo may still approach when its landing is over."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Landing:
    """An impact between cargo and machine, so far.

    Attributes:
        change: (3,) resulting change of the cargo's velocity, units/s.
        blow: Share of the impact in the cargo's force in the last interval.
        first: True if it began in that interval.
        bounce: Share of its speed beyond the least with which the cargo bounces off.
        leaving: Speed with which the cargo moves away at its end; negative while it approaches.
    """

    change: FloatArray
    blow: float
    first: bool
    bounce: float
    leaving: float

    @property
    def over(self) -> bool:
        """True once the cargo has been stopped."""
        return self.leaving >= -_LEFT * _size(self.change)

    @property
    def counts(self) -> bool:
        """True if it was fast enough to count."""
        return _size(self.change) >= MIN_LANDING_SPEED

    @property
    def _approach(self) -> float:
        """Speed with which the cargo came, units/s."""
        return _size(self.change) - self.leaving

    @property
    def _rebound(self) -> float:
        """Speed with which it bounces off, units/s."""
        return self.bounce * max(self._approach - MIN_LANDING_SPEED, 0.0)

    @property
    def stress(self) -> float:
        """Factor by which the bounce increases the forces between the bodies."""
        return 1.0 + self.blow * self._rebound / self._approach

    @property
    def fading(self) -> float:
        """The share of the filtered loads that gives way to those of the last interval."""
        return 1.0 if self.first else 1.0 - self.blow

    @property
    def bounced(self) -> FloatArray:
        """(3,) what the cargo's velocity gains by bouncing off, units/s."""
        size = _size(self.change)
        return self.change * ((self._rebound - self.leaving) / size)


def _size(vector: FloatArray) -> float:
    """Return the norm of a vector (3,)."""
    return math.sqrt(vector.dot(vector))


def landing_of(
    contacts: ContactForces,
    before: CargoPose,
    now: CargoPose,
    *,
    so_far: Landing | None,
    mass: float,
    machine_mass: float,
    gravity: float,
    interval_s: float,
) -> Landing | None:
    """Return the landing of a cargo on a machine in an interval; None if there is none.

    Args:
        contacts: Contacts of the machine, mean of the interval.
        before: The cargo at the start of the interval.
        now: The cargo at its end.
        so_far: Its landing up to the start of the interval.
        mass: Mass of the cargo, mass units.
        machine_mass: Mass of the whole machine, mass units.
        gravity: Downward acceleration, units/s².
        interval_s: Length of the interval, seconds.
    """
    weight = np.array([0.0, 0.0, gravity * interval_s])
    stopped = now.velocity - before.velocity + weight
    pressed = _size(np.add.reduce(contacts.force[contacts.other == CARGO]))
    if pressed < _MIN_SHARE * mass * _size(stopped) / interval_s:
        return None
    begun = so_far is not None and not so_far.over
    # A steady support is not an impact: it rests for half of the interval in which it lands.
    change = stopped - weight * (1.0 if begun else 0.5)
    speed = _size(change)
    if speed < _MIN_CHANGE or change[2] < _UPWARDS * speed:
        return None
    total = change if so_far is None or so_far.over else so_far.change + change
    size = _size(total)
    return Landing(
        change=total,
        blow=min(mass * speed / interval_s / pressed, 1.0),
        first=not begun,
        bounce=CARGO_BOUNCE / (1.0 + machine_mass / BOUNCE_MASS),
        leaving=float(now.velocity @ total) / size,
    )
