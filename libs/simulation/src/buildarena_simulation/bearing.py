"""Reads what bears the machine, and what the machine bears, off the contacts."""

import numpy as np
from numpy.typing import NDArray

from buildarena_simulation.structure.contacts import CARGO, PointForces
from buildarena_simulation.structure.model import IntArray, Structure
from buildarena_simulation.trajectory import Bearing


class BearingMeter:
    """Reads the bearing forces off the contacts of one instant.

    Args:
        structure: The machine.
        terrain_count: Number of terrain boxes.
        gravity: Downward acceleration, units/s²: forces are multiples of what it makes of a mass.

    Attributes:
        now: What `series` takes of an instant.
        on_blocks: (N,) what ground and terrain exert on each block upwards, mass·g.
    """

    def __init__(self, structure: Structure, terrain_count: int, *, gravity: float) -> None:
        self._gravity = gravity
        self._surfaces = terrain_count + 1
        self._wheels = structure.wheels
        self._blocks = len(structure)
        self.now: NDArray[np.float64] = np.zeros(self._surfaces + 1 + len(self._wheels))
        self.on_blocks: NDArray[np.float64] = np.zeros(self._blocks)

    def read(self, other: IntArray, surface: IntArray, forces: PointForces) -> None:
        """Takes the present contacts.

        Args:
            other: (K,) as in `ContactForces`.
            surface: (K,) as in `ContactForces`.
            forces: (K,) the forces on the blocks.
        """
        up = forces.force[:, 2] / self._gravity
        fixed = (surface >= 0).nonzero()[0]
        borne = up.take(fixed)
        on_surface = np.bincount(surface.take(fixed), borne, self._surfaces)
        on_block = np.bincount(forces.block.take(fixed), borne, self._blocks)
        self.on_blocks = np.asarray(on_block, dtype=np.float64)
        cargo = -up[other == CARGO].sum()
        self.now = np.concatenate([on_surface, [cargo], on_block[self._wheels]])

    def add_held(self, ground: float, cargo: float) -> None:
        """Takes what grips hold: the ground on them, and they on the cargo, mass·g upwards."""
        self.now[0] += ground
        self.now[self._surfaces] += cargo

    def series(self, rows: NDArray[np.float64], wheel_ids: tuple[str, ...]) -> Bearing:
        """The bearing of readings (T, K + 2 + W), each a `now`."""
        grained = np.round(rows * 256.0).astype(np.float32) / np.float32(256.0)
        k = self._surfaces
        return Bearing(
            ground=grained[:, 0].copy(),
            terrain=grained[:, 1:k].copy(),
            cargo=grained[:, k].copy(),
            wheels=grained[:, k + 1 :].copy(),
            wheel_ids=wheel_ids,
        )
