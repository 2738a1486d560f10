"""Friction of clusters whose blocks differ in it: PyBullet knows one coefficient per body."""

from collections.abc import Mapping, Sequence

import numpy as np

from buildarena_simulation.engines.pybullet.bodies import set_friction
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.engines.shared.closest_points import ShapeTable
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.structure.motion import Motion

with quiet_output():
    import pybullet


def mixed_clusters(structure: Structure, clusters: Clusters) -> tuple[int, ...]:
    """Clusters without a wheel whose blocks differ in friction."""
    mixed = []
    for c, blocks in enumerate(clusters.blocks):
        parts = [structure.parts[i] for i in blocks]
        alike = len({part.physics.friction for part in parts}) == 1
        if not alike and not any(part.is_wheel for part in parts):
            mixed.append(c)
    return tuple(mixed)


def follow_friction(
    client: Mapping[str, int],
    structure: Structure,
    clusters: Mapping[int, tuple[int, int]],
    shapes: Sequence[ShapeTable],
    motion: Motion,
) -> None:
    """Gives bodies the friction of those of their blocks that touch something, by their loads.

    Args:
        client: The engine's world.
        structure: The machine.
        clusters: Body and link of each cluster to follow.
        shapes: (C,) shapes of each cluster.
        motion: Where the clusters are.
    """
    coefficients = np.array([part.physics.friction for part in structure.parts])
    for c, (body, link) in clusters.items():
        touching = [
            (contact[5] if (contact[1], contact[3]) == (body, link) else contact[6], contact[9])
            for contact in pybullet.getContactPoints(body, **client)
            if (body, link) in ((contact[1], contact[3]), (contact[2], contact[4]))
        ]
        if not touching:
            continue
        points = np.array([point for point, _ in touching])
        loads = np.array([max(load, 1e-6) for _, load in touching])
        local = (points - motion.position[c]) @ motion.rotation[c]
        row, block, weight = shapes[c].share(local)
        shares = weight * loads[row]
        friction = float(shares @ coefficients[block] / shares.sum())
        set_friction(client, body, link, friction)
