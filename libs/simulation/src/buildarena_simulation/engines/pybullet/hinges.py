"""Motion of clusters on hinges, for engines that report hinge angles only."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from buildarena_simulation.engines.pybullet.joints import Articulation
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross, turn_about

with quiet_output():
    import pybullet


@dataclass(frozen=True, slots=True, kw_only=True)
class HingedComponent:
    """A multibody of an engine; its links are the component's clusters in order.

    Attributes:
        body: The engine's id of it.
        inside: Its clusters, the root first.
        links: The engine's link of each of them; the root's is -1.
        articulation: Its joints, if one of them is more than a simple axle; else None, and the
            other attributes describe them.
        wheel_signs: Per hinge, -1 where the link turned is not the wheel's but its mount's.
        wheel_places: Per hinge, which wheel of the structure it is.
        wheel_torques: Per hinge, torque limit of its motor, mass·unit²/s².
    """

    body: int
    inside: tuple[int, ...]
    links: Mapping[int, int]
    articulation: Articulation | None
    wheel_signs: FloatArray
    wheel_places: IntArray
    wheel_torques: FloatArray

    def follow(self, targets: FloatArray, client: Mapping[str, int]) -> None:
        """Set the targets of the drives.

        Args:
            targets: (D,) as in `Schedule.targets`.
            client: The engine's world.
        """
        if self.articulation is not None:
            self.articulation.follow(targets)
        elif count := len(self.wheel_signs):
            pybullet.setJointMotorControlArray(
                self.body,
                range(count),
                pybullet.VELOCITY_CONTROL,
                targetVelocities=(targets[self.wheel_places] * self.wheel_signs).tolist(),
                forces=self.wheel_torques.tolist(),
                **client,
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class HingeFrames:
    """Relative rotations of clusters when their hinges were at angle 0.

    Attributes:
        parent_from_child: (C, 3, 3) parent cluster's machine frame from the cluster's own, at angle
            0; meaningless for a root.
    """

    structure: Structure
    clusters: Clusters
    parent_from_child: FloatArray

    def follow(self, motion: Motion, c: int, angle: float, rate: float) -> None:
        """Compute a cluster's motion from its parent's.

        Args:
            motion: Motion of all clusters; the cluster's is written.
            c: Cluster.
            angle: Angle of its hinge, rad.
            rate: Rate of its hinge, rad/s.
        """
        clusters, wheel = self.clusters, self.clusters.attached[c]
        parent = clusters.parent[c]
        axis, hinge = self.structure.joints.axes[wheel], self.structure.joints.points[wheel]
        rotation, position = motion.rotation, motion.position
        rotation[c] = rotation[parent] @ self.parent_from_child[c] @ turn_about(axis, angle)
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
    """Return the hinges of clusters in a motion in which all their angles count as 0."""
    up = np.maximum(clusters.parent, 0)
    return HingeFrames(
        structure=structure,
        clusters=clusters,
        parent_from_child=motion.rotation[up].transpose(0, 2, 1) @ motion.rotation,
    )
