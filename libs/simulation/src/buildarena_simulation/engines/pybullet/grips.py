"""PyBullet's fixed constraints: what blocks hold."""

from collections.abc import Mapping

import numpy as np

from buildarena_simulation.engines.base import quaternion_of
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import WORLD
from buildarena_simulation.structure.grips import Hold
from buildarena_simulation.structure.model import FloatArray
from buildarena_simulation.structure.motion import Motion

with quiet_output():
    import pybullet


class BulletGrips:
    """The fixed constraints of a world.

    Args:
        client: The world, as keyword arguments.
    """

    def __init__(self, client: Mapping[str, int]) -> None:
        self._client = client
        self._constraints: list[int] = []
        self.holds: tuple[Hold, ...] = ()

    def leave(self) -> None:
        """Remove the constraints before their bodies are removed."""
        for constraint in self._constraints:
            pybullet.removeConstraint(constraint, **self._client)
        self._constraints = []

    def enter(
        self,
        clusters: Clusters,
        motion: Motion,
        axes: FloatArray,
        address: Mapping[int, tuple[int, int]],
        cargo: int | None,
    ) -> None:
        """Attach each held body at its present pose.

        Args:
            axes: (C, 3, 3) machine_from_principal.
            address: Body and link of each cluster.
            cargo: Body of the cargo.
        """
        centers = motion.centers_of_mass(clusters)

        def frame(c: int) -> tuple[FloatArray, FloatArray]:
            return centers[c], motion.rotation[c] @ axes[c]

        for hold in self.holds:
            c = int(clusters.cluster_of[hold.block])
            point = motion.position[c] + motion.rotation[c] @ hold.point
            if hold.other >= 0:
                other = int(clusters.cluster_of[hold.other])
                held, place = address[other], frame(other)
            elif hold.other == WORLD:
                held, place = (-1, -1), (np.zeros(3), np.eye(3))
            else:
                position, turn = pybullet.getBasePositionAndOrientation(cargo, **self._client)
                rotation = np.array(pybullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
                held, place = (int(cargo or 0), -1), (np.array(position), rotation)
            (first, first_turn), (second, second_turn) = (
                _to_frame(body, point) for body in (frame(c), place)
            )
            self._constraints.append(
                pybullet.createConstraint(
                    *address[c],
                    *held,
                    pybullet.JOINT_FIXED,
                    (0.0, 0.0, 0.0),
                    first,
                    second,
                    first_turn,
                    second_turn,
                    **self._client,
                )
            )

    def wrenches(self) -> FloatArray:
        """Return the force and moment on each block that holds, about its hold's point, (H, 6).

        World frame, mass·unit/s² and mass·unit²/s².
        """
        wrenches = np.zeros((len(self.holds), 6))
        for row, constraint in enumerate(self._constraints):
            state = pybullet.getConstraintState(constraint, **self._client)
            if len(state) == len(wrenches[row]):  # none before its first step
                wrenches[row] = state
        return wrenches


def _to_frame(
    frame: tuple[FloatArray, FloatArray], point: FloatArray
) -> tuple[list[float], list[float]]:
    """Convert a point, and the world's axes as a quaternion (x, y, z, w), to a frame."""
    center, rotation = frame
    turn = quaternion_of(rotation.T)
    return (rotation.T @ (point - center)).tolist(), turn[[1, 2, 3, 0]].tolist()
