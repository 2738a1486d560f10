"""Motion of clusters on hinges, for engines that report hinge angles only."""

from dataclasses import dataclass

import numpy as np

from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross


@dataclass(frozen=True, slots=True, kw_only=True)
class HingedPiece:
    """A multibody of an engine; its links are the piece's clusters in order.

    Attributes:
        body: The engine's id of it.
        inside: Its clusters, the root first.
        wheel_signs: Per hinge, -1 where the link turned is not the wheel's but its mount's.
        wheel_places: Per hinge, which wheel of the structure it is.
        wheel_torques: Per hinge, torque limit of its motor, mass·unit²/s².
    """

    body: int
    inside: tuple[int, ...]
    wheel_signs: FloatArray
    wheel_places: IntArray
    wheel_torques: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class HingeFrames:
    """How clusters stood on their hinges when these stood at angle 0.

    Attributes:
        structure: The machine.
        clusters: Its clusters.
        parent_from_child: (C, 3, 3) parent cluster's machine frame from the cluster's own, at
            angle 0; for a root, without meaning.
    """

    structure: Structure
    clusters: Clusters
    parent_from_child: FloatArray

    def follow(self, motion: Motion, c: int, angle: float, rate: float) -> None:
        """Fills in a cluster's motion from its parent's.

        Args:
            motion: Motion of all clusters; the parent's is known, the cluster's is written.
            c: The cluster.
            angle: Of its hinge, rad.
            rate: Of its hinge, rad/s.
        """
        clusters, wheel = self.clusters, self.clusters.wheel[c]
        parent = clusters.parent[c]
        axis, hinge = self.structure.directions[wheel], self.structure.positions[wheel]
        rotation, position = motion.rotation, motion.position
        rotation[c] = rotation[parent] @ self.parent_from_child[c] @ _turn_about(axis, angle)
        point = position[parent] + rotation[parent] @ hinge
        position[c] = point - rotation[c] @ hinge
        motion.spin[c] = motion.spin[parent] + rate * (rotation[c] @ axis)
        parent_center = position[parent] + rotation[parent] @ clusters.center_of_mass[parent]
        center = position[c] + rotation[c] @ clusters.center_of_mass[c]
        motion.velocity[c] = (
            motion.velocity[parent]
            + cross(motion.spin[parent], point - parent_center)
            + cross(motion.spin[c], center - point)
        )


def hinge_frames(structure: Structure, clusters: Clusters, motion: Motion) -> HingeFrames:
    """The hinges of clusters in a motion in which all their angles count as 0."""
    up = np.maximum(clusters.parent, 0)
    return HingeFrames(
        structure=structure,
        clusters=clusters,
        parent_from_child=motion.rotation[up].transpose(0, 2, 1) @ motion.rotation,
    )


def hinge_rate(structure: Structure, clusters: Clusters, motion: Motion, c: int) -> float:
    """Speed at which a cluster turns on its hinge, rad/s."""
    axis = motion.rotation[c] @ structure.directions[clusters.wheel[c]]
    return float((motion.spin[c] - motion.spin[clusters.parent[c]]) @ axis)


def _turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation by an angle about a unit axis (Rodrigues), (3, 3)."""
    x, y, z = axis
    cross_matrix = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(
        np.eye(3) + np.sin(angle) * cross_matrix + (1 - np.cos(angle)) * cross_matrix @ cross_matrix
    )
