"""Wheels on ground and terrain: contacts that yield, so that friction lifts no wheel.

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
"""How far all wheels together yield under the weight of machine and cargo, units."""

_IMPEDANCE: Final = 0.001
"""Of a wheel's contact: the push of a slip of 10 units/s is below 3 % of its load."""

_POINTS: Final = 2
"""Points at which a wheel stands: the ends of its lowest line."""

_STIFFEST: Final = 7500.0
_MOST_DAMPED: Final = 125.0
"""Bounds of a contact's stiffness, 1/s², and damping, 1/s, times the largest compliance of its
wheel: a step is explicit in such a contact, and a wheel on a spring gives way more than
a machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelContacts:
    """The contacts of wheels with ground and terrain in a compiled model; P of them.

    Attributes:
        pairs: (P,) the model's pairs.
        compliance: (P,) by which the model scales its contacts' softness, 1/mass unit.
        largest: (P,) velocity that each wheel gains per unit impulse, where it gives way most,
            1/mass unit.
        wheels: How many wheels there are.
        gravity: Units/s².
    """

    pairs: IntArray
    compliance: FloatArray
    largest: FloatArray
    wheels: int
    gravity: float

    def bear(self, model: "mujoco.MjModel", mass: float) -> None:
        """Makes the contacts as stiff as a mass on the wheels needs.

        Args:
            model: The model.
            mass: Of machine and cargo, mass units.
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
    """Finds the contacts of wheels in a compiled model, named "wheel …", and softens them.

    Args:
        model: The model.
        data: Its state, after `mj_forward`.
        wheels: How many wheels the machine has.
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
    """Velocity of a body's centre per unit impulse on it, the largest of all directions."""
    along, gained = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, along, None, body)
    mujoco.mj_solveM(model, data, gained, along)
    return float(np.linalg.eigvalsh(along @ gained.T)[-1])
