"""Indices of clusters, blocks, joints and ropes in a compiled MuJoCo model."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from buildarena_simulation.engines.base import World
from buildarena_simulation.engines.mujoco.joints import JointAddresses, joint_addresses
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import CARGO, WORLD
from buildarena_simulation.structure.model import BoolArray, IntArray
from buildarena_simulation.structure.solids import Solid


@dataclass(frozen=True, slots=True, kw_only=True)
class Addresses:
    """Indices of clusters, blocks, wheels and ropes in a compiled model.

    Attributes:
        bodies: (C,) body of each cluster.
        body_of_geom: Cluster of each geom, `CARGO` or `WORLD`.
        block_of_geom: Block of each geom that represents one only, else -1.
        surface_of_geom: Fixed body of each geom as in `ContactForces.surface`.
        thrust_actuators: (K,) actuator of each cannon.
        free_dofs: (3 F,) linear velocities of the free bodies, the cargo first.
        spin_dofs: (P, 3) angular velocities of the components.
        tendons: Tendon of each rope that holds.
    """

    bodies: IntArray
    body_of_geom: IntArray
    block_of_geom: IntArray
    surface_of_geom: IntArray
    joints: JointAddresses
    thrust_actuators: IntArray
    free_dofs: IntArray
    spin_dofs: IntArray
    tendons: Mapping[int, int]


def addresses_in(
    model: "mujoco.MjModel",
    world: World,
    clusters: Clusters,
    solids: Sequence[Sequence[Solid]],
    rope_alive: BoolArray,
) -> Addresses:
    """Find the indices in a model compiled from the MJCF of `model`.

    Args:
        world: World that it was made from.
        solids: Collision shapes by cluster.
        rope_alive: (R,) true for ropes and springs that hold.
    """
    structure = world.structure
    body_of_geom = np.full(model.ngeom, CARGO, dtype=np.int64)
    block_of_geom, surface_of_geom = (np.full(model.ngeom, -1, dtype=np.int64) for _ in range(2))
    for c, of_cluster in enumerate(solids):
        for k, solid in enumerate(of_cluster):
            geom = model.geom(f"solid {c} {k}").id
            body_of_geom[geom] = c
            if len(solid.blocks) == 1:
                block_of_geom[geom] = solid.blocks[0]
    fixed = [(f"terrain {k}", k + 1) for k in range(len(world.terrain))]
    for name, surface in [("ground", 0)] * world.ground + fixed:
        geom = model.geom(name).id
        body_of_geom[geom], surface_of_geom[geom] = WORLD, surface
    components = [
        model.joint(f"free {component[0]}").dofadr[0] for component in clusters.components
    ]
    # Only the cargo can come before the components; its free joint is the first.
    free = components if components[0] == 0 else [0, *components]
    return Addresses(
        bodies=_ids(model.body(f"cluster {c}").id for c in range(len(clusters))),
        body_of_geom=body_of_geom,
        block_of_geom=block_of_geom,
        surface_of_geom=surface_of_geom,
        joints=joint_addresses(model, structure, clusters),
        thrust_actuators=_ids(model.actuator(f"cannon {i}").id for i in structure.cannons),
        free_dofs=(_ids(free)[:, None] + np.arange(3)).reshape(-1),
        spin_dofs=_ids(components)[:, None] + np.arange(3, 6),
        tendons={int(r): model.tendon(f"rope {r}").id for r in np.flatnonzero(rope_alive)},
    )


def _ids(numbers: Iterable[int]) -> IntArray:
    return np.array([int(number) for number in numbers], dtype=np.int64)
