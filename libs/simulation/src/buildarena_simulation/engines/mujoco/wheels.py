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

_STIFFEST, _MOST_DAMPED = 0.1, 0.5
"""Bounds of stiffness and damping, per 1/(compliance·dt²) and 1/(compliance·dt): a step is explicit
in such a contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelContacts:
    """The contacts of wheels with ground and terrain in a compiled model; P of them.

    Attributes:
        pairs: (P,) the model's pairs.
        compliance: (P,) velocity that each wheel gains per unit impulse, 1/mass unit.
        wheels: How many wheels there are.
    """

    pairs: IntArray
    compliance: FloatArray
    wheels: int

    def bear(self, model: "mujoco.MjModel", mass: float) -> None:
        """Makes the contacts as stiff as a mass on the wheels needs.

        Args:
            model: The model.
            mass: Of machine and cargo, mass units.
        """
        if not len(self.pairs):
            return
        gravity, step = -model.opt.gravity[2], model.opt.timestep
        share = mass / (_POINTS * self.wheels)
        given = (1.0 - _IMPEDANCE) * self.compliance
        stiffness = np.minimum(share * gravity / _SAG, _STIFFEST / (self.compliance * step * step))
        damping = np.minimum(
            2.0 * np.sqrt(stiffness * share), _MOST_DAMPED / (self.compliance * step)
        )
        model.pair_solref[self.pairs, 0] = -given * stiffness
        model.pair_solref[self.pairs, 1] = -given * damping


def wheel_contacts(model: "mujoco.MjModel", wheels: int, friction_s: float) -> WheelContacts:
    """Finds the contacts of wheels in a compiled model, named "wheel …", and softens them.

    Args:
        model: The model.
        wheels: How many wheels the machine has.
        friction_s: Time constant with which friction stops a slip, seconds.
    """
    pairs = [p for p in range(model.npair) if model.pair(p).name.startswith("wheel ")]
    bodies = model.geom_bodyid[model.pair_geom2[pairs]]
    model.pair_solimp[pairs] = (_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 2.0)
    model.pair_solreffriction[pairs] = (-1e-9, -2.0 / friction_s * _IMPEDANCE)
    return WheelContacts(
        pairs=np.array(pairs, dtype=np.int64),
        compliance=model.body_invweight0[bodies, 0],
        wheels=wheels,
    )
