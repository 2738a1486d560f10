"""The contacts of one of MuJoCo's steps, stored to be read when the next one has been made."""

from dataclasses import dataclass

import mujoco
import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class StepContacts:
    """Contacts that exert a force; K of them.

    Attributes:
        geoms: (K, 2) of the model.
        point: (K, 3) world frame, units.
        frames: (K, 3, 3) rows are normal and tangents.
        components: (K, 3) of the force along them, mass·unit/s².
    """

    geoms: IntArray
    point: FloatArray
    frames: FloatArray
    components: FloatArray

    @property
    def pressed(self) -> float:
        """What they press together, mass·unit/s²."""
        return float(self.components[:, 0].sum())


def step_contacts(data: "mujoco.MjData") -> StepContacts:
    """The contacts of the last step.

    Args:
        data: State of the model.
    """
    contact, address = data.contact, data.contact.efc_address[: data.ncon]
    active = (address >= 0).nonzero()[0]
    return StepContacts(
        geoms=contact.geom[active],
        point=contact.pos[active],
        frames=contact.frame[active].reshape(-1, 3, 3),
        components=data.efc_force[address[active][:, None] + np.arange(3)],
    )
