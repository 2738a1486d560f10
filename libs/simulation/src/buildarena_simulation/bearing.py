"""What bears the machine and what the machine bears: vertical forces, sampled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.structure.contacts import CARGO, PointForces
from buildarena_simulation.structure.model import IntArray, Structure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bearing:
    """Vertical contact forces at T instants, each the mean over a moment before it, mass·g.

    Upwards is positive. K terrain boxes, W wheels. Arrays are read-only.

    Attributes:
        ground: (T,) float32, of the ground on the machine.
        terrain: (T, K) float32, of each terrain box on the machine.
        cargo: (T,) float32, of the machine on the cargo.
        wheels: (T, W) float32, of ground and terrain on each wheel.
        wheel_ids: (W,) ids of the wheels.
    """

    ground: NDArray[np.float32]
    terrain: NDArray[np.float32]
    cargo: NDArray[np.float32]
    wheels: NDArray[np.float32]
    wheel_ids: tuple[str, ...]

    def __post_init__(self) -> None:
        """Checks that the arrays fit together, and closes them."""
        count = len(self.ground)
        shapes = {
            "ground": (count,),
            "terrain": (count, self.terrain.shape[-1]),
            "cargo": (count,),
            "wheels": (count, len(self.wheel_ids)),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
            array.setflags(write=False)


class BearingMeter:
    """Reads the bearing forces off the contacts of one instant.

    Args:
        structure: The machine.
        terrain_count: Number of terrain boxes.
    """

    def __init__(self, structure: Structure, terrain_count: int) -> None:
        self._surfaces = terrain_count + 1
        self._wheels = structure.wheels
        self._blocks = len(structure)
        self.now: NDArray[np.float64] = np.zeros(self._surfaces + 1 + len(self._wheels))

    def read(self, other: IntArray, surface: IntArray, forces: PointForces) -> None:
        """Takes the contacts as they stand.

        Args:
            other: (K,) as in `ContactForces`.
            surface: (K,) as in `ContactForces`.
            forces: (K,) the forces on the blocks.
        """
        up = forces.force[:, 2] / GRAVITY
        fixed = np.flatnonzero(surface >= 0)
        on_surface = np.bincount(surface[fixed], up[fixed], minlength=self._surfaces)
        on_block = np.bincount(forces.block[fixed], up[fixed], minlength=self._blocks)
        cargo = -up[other == CARGO].sum()
        self.now = np.concatenate([on_surface, [cargo], on_block[self._wheels]])

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
