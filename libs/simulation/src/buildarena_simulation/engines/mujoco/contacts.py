"""The contacts of one of MuJoCo's steps, stored to be read when the next one has been made."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from buildarena_simulation.engines.mujoco.addresses import Addresses
from buildarena_simulation.engines.shared.closest_points import ShapeTable, shape_table
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion

_AXES: Final = np.arange(3)
_SIGNS: Final = np.array([[-1.0], [1.0]])
"""Signs of a contact's normal and force for its first and its second geom."""


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
        """Sum of the contacts' normal forces, mass·unit/s²."""
        return float(self.components[:, 0].sum())


def step_contacts(data: "mujoco.MjData") -> StepContacts:
    """Return the contacts of the last step.

    Args:
        data: State of the model.
    """
    contact = data.contact
    address = contact.efc_address
    active = (address >= 0).nonzero()[0]
    return StepContacts(
        geoms=contact.geom.take(active, 0),
        point=contact.pos.take(active, 0),
        frames=contact.frame.take(active, 0).reshape(-1, 3, 3),
        components=data.efc_force.take(address.take(active)[:, None] + _AXES),
    )


class ContactReader:
    """Reader of contact forces on blocks from a compiled model's contacts."""

    def __init__(self, structure: Structure, clusters: Clusters, addresses: Addresses) -> None:
        self._structure, self._clusters, self._at = structure, clusters, addresses
        self._shapes: dict[int, ShapeTable] = {}

    def forces(self, contacts: StepContacts, motion: Callable[[], Motion]) -> ContactForces:
        """Return the forces of some contacts."""
        at, geoms = self._at, contacts.geoms
        # MuJoCo's contact force acts on the second geom; its frame's rows are normal and tangents.
        force = (contacts.components[:, None] @ contacts.frames)[:, 0]
        # Per contact of a first geom, then of a second one, that is a cluster's.
        side, row = (at.body_of_geom.take(geoms.T) >= 0).nonzero()
        own, facing = geoms[row, side], geoms[row, 1 - side]
        point = contacts.point.take(row, 0)
        index, block, weight = self._blocks_at(own, point, motion)
        facing, row, sign = facing.take(index), row.take(index), _SIGNS.take(side.take(index), 0)
        return ContactForces(
            block=block,
            other=at.body_of_geom.take(facing),
            surface=at.surface_of_geom.take(facing),
            weight=weight,
            area=np.zeros(len(block)),
            normal=sign * contacts.frames[:, 0].take(row, 0),
            point=point.take(index, 0),
            force=sign * force.take(row, 0) * weight[:, None],
        )

    def _blocks_at(
        self, geoms: IntArray, points: FloatArray, motion: Callable[[], Motion]
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return rows of a contact and a block: the contact's index, the block, its share."""
        block = self._at.block_of_geom.take(geoms)
        lone = (block >= 0).nonzero()[0]
        if len(lone) == len(geoms):
            return lone, block, np.ones(len(lone))
        rows, blocks, weights = [lone], [block.take(lone)], [np.ones(len(lone))]
        now = motion()
        cluster = np.where(block >= 0, -1, self._at.body_of_geom.take(geoms))
        for c in sorted(set(cluster.tolist()) - {-1}):
            if c not in self._shapes:
                self._shapes[c] = shape_table(self._structure, self._clusters.blocks[c])
            among = (cluster == c).nonzero()[0]
            local = (points.take(among, 0) - now.position[c]) @ now.rotation[c]
            row, sharing, weight = self._shapes[c].share(local)
            rows.append(among.take(row))
            blocks.append(sharing)
            weights.append(weight)
        return np.concatenate(rows), np.concatenate(blocks), np.concatenate(weights)
