"""Wheels on ground and terrain, with compliant contacts so that friction lifts no wheel.

MuJoCo's contacts are convex: a slip pushes the bodies apart as fast as friction pulls against it.
On a hard contact that lifts a wheel that slips, which falls back and hops. On one that yields, the
share of that push in the load is the smaller the softer the contact is held against its own mass
(impedance); the wheels of a rigid body then share its weight as equal springs do.
"""

from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray

_SAG: Final = 0.001
"""Total compliance of all wheels under the weight of machine and cargo, units."""

_IMPEDANCE: Final = 0.001
"""Impedance of a wheel's contact: the push of a slip of 10 units/s is below 3 % of its load."""

_POINTS: Final = 2
"""Contact points of a wheel: the ends of its lowest line."""

_STIFFEST: Final = 7500.0
_MOST_DAMPED: Final = 125.0
"""Bounds of a contact's stiffness, 1/s², and damping, 1/s, times the largest compliance of its
wheel: a step is explicit in such a contact, and a wheel on a spring gives way more than
a machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelContacts:
    """Contacts of wheels with ground and terrain in a compiled model; P of them.

    Attributes:
        pairs: (P,) pairs of the model.
        compliance: (P,) factor of the model for its contacts' softness, 1/mass unit.
        largest: (P,) velocity that each wheel gains per unit impulse, in its most compliant
            direction, 1/mass unit.
        wheels: Number of wheels.
        gravity: Units/s².
    """

    pairs: IntArray
    compliance: FloatArray
    largest: FloatArray
    wheels: int
    gravity: float

    def support(self, model: "mujoco.MjModel", mass: float) -> None:
        """Adapt the contacts' stiffness to the mass on the wheels.

        Args:
            mass: Mass of machine and cargo, mass units.
        """
        if not len(self.pairs):
            return
        share = mass / (_POINTS * self.wheels)
        scale = (1.0 - _IMPEDANCE) * self.compliance
        stiffness = np.minimum(share * self.gravity / _SAG, _STIFFEST / self.largest)
        damping = np.minimum(2.0 * np.sqrt(stiffness * share), _MOST_DAMPED / self.largest)
        model.pair_solref[self.pairs, 0] = -scale * stiffness
        model.pair_solref[self.pairs, 1] = -scale * damping


def wheel_contacts(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    wheels: int,
    *,
    friction_s: float,
    gravity: float,
) -> WheelContacts:
    """Find the contacts of wheels in a compiled model, named "wheel …", and soften them.

    Args:
        data: Its state, after `mj_forward`.
        wheels: Number of wheels.
        friction_s: Time constant with which friction stops a slip, seconds.
        gravity: Units/s².
    """
    pairs = [p for p in range(model.npair) if model.pair(p).name.startswith("wheel ")]
    bodies = model.geom_bodyid[model.pair_geom2[pairs]]
    model.pair_solimp[pairs] = (_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 2.0)
    model.pair_solreffriction[pairs] = (-1e-9, -2.0 / friction_s * _IMPEDANCE)
    return WheelContacts(
        pairs=np.array(pairs, dtype=np.int64),
        compliance=model.body_invweight0[bodies, 0],
        largest=np.array([_largest_compliance(model, data, body) for body in bodies.tolist()]),
        wheels=wheels,
        gravity=gravity,
    )


def _largest_compliance(model: "mujoco.MjModel", data: "mujoco.MjData", body: int) -> float:
    """Return the largest velocity of a body's centre per unit impulse on it, of all directions."""
    along, gained = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, along, None, body)
    mujoco.mj_solveM(model, data, gained, along)
    return float(np.linalg.eigvalsh(along @ gained.T)[-1])
