"""Positions and motion of the clusters, and their conversion at a break."""

from dataclasses import dataclass

import numpy as np

from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.vectors import cross, turned


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Poses and velocities of C clusters, world frame.

    Attributes:
        position: (C, 3) of the machine frame's origin, carried along by the cluster, units.
        rotation: (C, 3, 3) world_from_machine.
        velocity: (C, 3) of the cluster's centre of mass, units/s.
        spin: (C, 3) angular velocity, rad/s.
    """

    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    spin: FloatArray

    def points(self, clusters: Clusters, points: FloatArray) -> FloatArray:
        """Return the world position of one machine-frame point per block, (N, 3)."""
        c = clusters.cluster_of
        return np.asarray(self.position.take(c, 0) + turned(self.rotation.take(c, 0), points))

    def centers_of_mass(self, clusters: Clusters) -> FloatArray:
        """Return the centres of mass of the clusters, (C, 3), world frame, units."""
        return np.asarray(self.position + turned(self.rotation, clusters.center_of_mass))

    def after_break(self, old: Clusters, new: Clusters) -> "Motion":
        """Return the same motion, expressed for the clusters left after a break.

        Poses stay; each new cluster's centre of mass keeps the velocity the old cluster had there
        (v + cross(spin, r)), so linear and angular momentum stay as they were.
        """
        source = np.array([old.cluster_of[ids[0]] for ids in new.blocks])
        rotation, spin = self.rotation[source], self.spin[source]
        arm = turned(rotation, new.center_of_mass - old.center_of_mass[source])
        return Motion(
            position=self.position[source],
            rotation=rotation,
            velocity=self.velocity[source] + cross(spin, arm),
            spin=spin,
        )


def at_rest(clusters: Clusters, position: FloatArray, rotation: FloatArray) -> Motion:
    """Return all clusters at rest, the machine frame at one pose.

    Args:
        position: (3,) world position of the machine frame's origin, units.
        rotation: (3, 3) world_from_machine.
    """
    count = len(clusters)
    return Motion(
        position=np.tile(position, (count, 1)),
        rotation=np.tile(rotation, (count, 1, 1)),
        velocity=np.zeros((count, 3)),
        spin=np.zeros((count, 3)),
    )


def rope_ends(
    structure: Structure, clusters: Clusters, motion: Motion
) -> tuple[FloatArray, FloatArray]:
    """Return both ends of every rope, each (R, 3), world frame, units."""
    ropes = structure.ropes
    ends = []
    for block, point in ((ropes.first, ropes.first_point), (ropes.second, ropes.second_point)):
        c = clusters.cluster_of[block]
        ends.append(motion.position[c] + turned(motion.rotation[c], point))
    return ends[0], ends[1]
