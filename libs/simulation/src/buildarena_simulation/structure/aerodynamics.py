"""What air does to wings, blades and bowls: one law for both engines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from buildarena_geometry.modules.forces import Wing
from buildarena_simulation.structure.model import BoolArray, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Wings:
    """What air does to K blocks, in one frame; fields as in geometry's `Wing`.

    Attributes:
        normal: (K, 3) direction of the force, unit length.
        flow: (K, 3) direction of the flow that it answers to, unit length.
        coefficient: (K,) force per speed to the power of `power` + 1, mass·unit/s².
        power: (K,) how the force grows with the speed besides.
        cap_speed: (K,) the speed from which on it does not, units/s.
        one_sided: (K,) whether air that comes against the normal does nothing.
    """

    normal: FloatArray
    flow: FloatArray
    coefficient: FloatArray
    power: FloatArray
    cap_speed: FloatArray
    one_sided: BoolArray

    def __len__(self) -> int:
        return len(self.coefficient)

    def forces(self, velocity: FloatArray, fixed: BoolArray) -> FloatArray:
        """The force of the air on each block, (K, 3), mass·unit/s².

        A blade's law lets still air speed it up along its pitch, as what turns it makes up for in
        the game. Nothing turns a blade that is fixed: what would speed it up is left out of its
        force, so that the air takes energy and gives none.

        Args:
            velocity: (K, 3) of the blocks' centres, in the frame of the normals, units/s.
            fixed: (K,) which of them are fixed to the root of their component.
        """
        along = (velocity * self.flow).sum(axis=1)
        speed = np.sqrt((velocity * velocity).sum(axis=1))
        size = -self.coefficient * along * np.minimum(speed, self.cap_speed) ** self.power
        size = np.where(self.one_sided & (along < 0.0), 0.0, size)
        forces = size[:, None] * self.normal
        power = np.where(fixed, np.maximum((forces * velocity).sum(axis=1), 0.0), 0.0)
        return np.asarray(forces - (power / np.maximum(speed, 1e-9) ** 2)[:, None] * velocity)


def wings_of(wings: Sequence[Wing], rotations: FloatArray) -> Wings:
    """The wings of blocks that are turned.

    Args:
        wings: (K,) what the blocks' modules say.
        rotations: (K, 3, 3) of the blocks.
    """

    def turned_by(vectors: Sequence[Sequence[float]]) -> FloatArray:
        rows = np.array(vectors, dtype=np.float64).reshape(-1, 3)
        return np.asarray(np.einsum("kij,kj->ki", rotations, rows))

    return Wings(
        normal=turned_by([wing.normal for wing in wings]),
        flow=turned_by([wing.flow for wing in wings]),
        coefficient=np.array([wing.coefficient for wing in wings], dtype=np.float64),
        power=np.array([wing.power for wing in wings], dtype=np.float64),
        cap_speed=np.array([wing.cap_speed for wing in wings], dtype=np.float64),
        one_sided=np.array([wing.one_sided for wing in wings], dtype=bool),
    )
