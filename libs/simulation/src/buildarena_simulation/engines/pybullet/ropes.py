"""Ropes and springs for engines that have none: a rope is as stiff as the step allows.

A fixed stiffness diverges on small blocks; here it follows the effective mass between the rope's
ends, so that the explicit step stays stable whatever hangs on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import PointForces
from buildarena_simulation.structure.model import BoolArray, FloatArray, Structure
from buildarena_simulation.structure.motion import Motion, rope_ends
from buildarena_simulation.structure.vectors import cross, turned

with quiet_output():
    import pybullet

_STIFFNESS_SHARE = 0.2
_DAMPING_SHARE = 0.8
"""Shares of m/dt² and m/dt; an explicit step is stable below 1 each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RopePulls:
    """Effect of the ropes in one step.

    Attributes:
        tension: (R,) mass·unit/s².
        forces: Forces on both ends of every taut rope.
    """

    tension: FloatArray
    forces: PointForces


def rope_forces(
    structure: Structure,
    clusters: Clusters,
    motion: Motion,
    *,
    compliance: FloatArray,
    alive: BoolArray,
    rest_lengths: FloatArray,
    time_step_s: float,
) -> RopePulls:
    """Return the tension of the ropes at the start of a step.

    Args:
        compliance: (C, 3, 3) inverse of the clusters' inertias.
        alive: (R,) true for ropes that hold.
        rest_lengths: (R,) lengths at rest, units.
        time_step_s: Length of the step, seconds.
    """
    ropes = structure.ropes
    start, end = rope_ends(structure, clusters, motion)
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / np.maximum(length, 1e-9)[:, None]
    first, second = clusters.cluster_of[ropes.first], clusters.cluster_of[ropes.second]
    slip, give = _at_ends(
        clusters,
        motion,
        np.concatenate([first, second]),
        (np.concatenate([start, end]), np.concatenate([along, along])),
        compliance,
    )
    (slip_first, slip_second), (give_first, give_second) = np.split(slip, 2), np.split(give, 2)
    stretch, rate = length - rest_lengths, slip_second - slip_first
    mass = 1.0 / np.maximum(give_first + give_second, 1e-9)
    # Several ropes on one body act together; each takes its share.
    crowd = np.maximum(
        np.bincount(first, minlength=len(clusters))[first],
        np.bincount(second, minlength=len(clusters))[second],
    )
    mass = mass / crowd
    pull = (
        _STIFFNESS_SHARE * mass / time_step_s**2 * stretch
        + _DAMPING_SHARE * mass / time_step_s * rate
    )
    taut = alive & (stretch > 0.0) & (first != second)
    tension = np.where(taut, np.maximum(pull, 0.0), 0.0)
    if ropes.stiffness.any():
        elastic, limit = ropes.stiffness > 0.0, mass / time_step_s
        stiffness = np.minimum(ropes.stiffness, _STIFFNESS_SHARE * limit / time_step_s)
        damping = np.minimum(ropes.damping, _DAMPING_SHARE * limit)
        taut = np.where(elastic, alive, taut)
        tension = np.where(elastic & alive, stiffness * stretch + damping * rate, tension)
    force = tension[:, None] * along
    return RopePulls(
        tension=tension,
        forces=PointForces(
            block=np.concatenate([ropes.first[taut], ropes.second[taut]]),
            point=np.concatenate([start[taut], end[taut]]),
            force=np.concatenate([force[taut], -force[taut]]),
        ),
    )


def pull_ends(
    client: Mapping[str, int],
    forces: PointForces,
    clusters: Clusters,
    address: Mapping[int, tuple[int, int]],
) -> None:
    """Apply forces on blocks in the next step.

    Args:
        client: The engine's world.
        address: Body and link of each cluster.
    """
    for block, point, force in zip(forces.block, forces.point, forces.force, strict=True):
        body, link = address[int(clusters.cluster_of[block])]
        pybullet.applyExternalForce(
            body, link, force.tolist(), point.tolist(), pybullet.WORLD_FRAME, **client
        )


def _at_ends(
    clusters: Clusters,
    motion: Motion,
    c: np.ndarray,
    ends: tuple[FloatArray, FloatArray],
    compliance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return ropes' end speeds along them, and the ends' velocity per unit impulse, (2R,)."""
    point, along = ends
    arm = point - motion.centers_of_mass(clusters)[c]
    velocity = motion.velocity[c] + cross(motion.spin[c], arm)
    lever = turned(motion.rotation[c].transpose(0, 2, 1), cross(arm, along))
    gained = turned(compliance[c], lever)
    return (velocity * along).sum(axis=1), 1.0 / clusters.mass[c] + (lever * gained).sum(axis=1)
