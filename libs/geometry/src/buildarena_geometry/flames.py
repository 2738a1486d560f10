"""Contact between flames and cannons."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.blocks import Block
from buildarena_geometry.modules.module import Sphere
from buildarena_geometry.state import MachineState

_CONTACT = 1e-9  # units; rounding must not separate spheres that just touch


def flames_touch(
    bodies: NDArray[np.float64],
    body_radii: NDArray[np.float64],
    flames: NDArray[np.float64],
    flame_radii: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Find the flames that touch spheres of cannons.

    Args:
        bodies: (B, 3) centres of the cannons' spheres, units.
        body_radii: (B,) units.
        flames: (F, 3) centres of the flames, in the same frame, units.
        flame_radii: (F,) units.

    Returns:
        (B, F), true where sphere and flame touch.
    """
    distances = np.linalg.norm(bodies[:, None] - flames[None], axis=2) - body_radii[:, None]
    return np.asarray(distances <= flame_radii + _CONTACT)


def heating(state: MachineState) -> Mapping[str, tuple[str, ...]]:
    """Return the ids of the blocks whose flames heat each cannon of a machine as it was built.

    Returns:
        For each block that a flame can heat, in the order of the blocks, the ids of the blocks
        whose flames touch it.
    """
    cannons = [block for block in state.blocks.values() if _body(block)]
    torches = [block for block in state.blocks.values() if block.module.flames]
    if not cannons or not torches:
        return {cannon.id: () for cannon in cannons}
    bodies = [(cannon.id, cannon, sphere) for cannon in cannons for sphere in _body(cannon)]
    fires = [(torch.id, torch, flame) for torch in torches for flame in torch.module.flames]
    touching = flames_touch(*_spheres(bodies), *_spheres(fires))
    pairs = {(bodies[row][0], fires[column][0]) for row, column in np.argwhere(touching)}
    return {
        cannon.id: tuple(torch.id for torch in torches if (cannon.id, torch.id) in pairs)
        for cannon in cannons
    }


def _body(block: Block) -> tuple[Sphere, ...]:
    thrust = block.module.thrust
    return () if thrust is None else thrust.spheres


def _spheres(
    carried: Iterable[tuple[str, Block, Sphere]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centres, (K, 3), and radii, (K,), of spheres that blocks carry."""
    pairs = [(block.landmark(sphere.along), sphere.radius) for _, block, sphere in carried]
    return np.array([center for center, _ in pairs]), np.array([radius for _, radius in pairs])
