"""Moving joints in a compiled MuJoCo model: where they start, and the targets of their drives."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from buildarena_simulation.engines.base import quaternion_of, rotation_of
from buildarena_simulation.engines.shared.joint_frames import (
    driven_clusters,
    entered_place,
    is_simple,
    joint_rate,
    seat_of,
    sign_of,
)
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAddresses:
    """The driven joints of a compiled model; H of them.

    Attributes:
        driven: (H,) which of the structure's driven joints each is.
        signs: (H,) -1 where the body moved is not the seated block's but its mount's.
        actuators: (H,) actuator of each.
        gains: (H,) gain of each that turns freely at times, else 0.
    """

    driven: IntArray
    signs: FloatArray
    actuators: IntArray
    gains: FloatArray

    def follow(self, model: "mujoco.MjModel", data: "mujoco.MjData", row: FloatArray) -> None:
        """Gives the drives their targets.

        Args:
            model: The model.
            data: Its state.
            row: (D,) as in `Schedule.targets`.
        """
        if not len(self.driven):
            return
        wanted = row[self.driven] * self.signs
        if self.gains.any():
            rows = self.gains.nonzero()[0]
            free = np.isnan(wanted)
            on = np.where(free[rows], 0.0, self.gains[rows])
            model.actuator_gainprm[self.actuators[rows], 0] = on
            model.actuator_biasprm[self.actuators[rows], 2] = -on
            wanted[free] = 0.0
        data.ctrl[self.actuators] = wanted


def joint_addresses(
    model: "mujoco.MjModel", structure: Structure, clusters: Clusters
) -> JointAddresses:
    """Finds the driven joints in a compiled model.

    Args:
        model: The model.
        structure: The machine.
        clusters: Its clusters.
    """
    place = {int(block): d for d, block in enumerate(structure.joints.driven)}
    inside = driven_clusters(structure, clusters)
    actuators = np.array([model.actuator(f"hinge {c}").id for c in inside], dtype=np.int64)
    joints = [structure.parts[clusters.seated[c]].module.joint for c in inside]
    free = [
        joint is not None and joint.drive is not None and joint.drive.default_mode == "free"
        for joint in joints
    ]
    return JointAddresses(
        driven=np.array([place[int(clusters.seated[c])] for c in inside], dtype=np.int64),
        signs=np.array([sign_of(clusters, c) for c in inside]),
        actuators=actuators,
        gains=np.where(free, model.actuator_gainprm[actuators, 0], 0.0) if inside else np.zeros(0),
    )


def enter_joint(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    bodies: tuple[Structure, Clusters, FloatArray],
    motion: Motion,
    *,
    c: int,
    targets: FloatArray | None,
) -> None:
    """Gives a cluster's joint the position and the rate that the cluster's motion implies.

    Args:
        model: The model.
        data: Its state, changed in place.
        bodies: The machine, its clusters, and (C, 3, 3) machine_from_principal.
        motion: The clusters' motion.
        c: The cluster.
        targets: (D,) what the driven joints aimed at last; None at the start.
    """
    structure, clusters, axes = bodies
    joint = model.joint(f"hinge {c}")
    if is_simple(structure, clusters, c):
        data.qvel[joint.dofadr[0]] = joint_rate(structure, clusters, motion, c)
        return
    seat = seat_of(structure, clusters, c)
    entered = entered_place(structure, clusters, motion, c, targets)
    place, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
    if seat == "ball":
        turn = axes[c].T @ rotation_of(entered.place) @ axes[c]
        data.qpos[place : place + 4] = quaternion_of(turn)
        data.qvel[dof : dof + 3] = axes[c].T @ entered.rate
        return
    count = len(entered.place)
    data.qpos[place : place + count] = entered.place
    data.qvel[dof : dof + count] = entered.rate


def drag_apart(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    bodies: tuple[Clusters, IntArray],
    motion: Motion,
    components: Sequence[Sequence[int]],
) -> None:
    """Applies the drag of every cluster of some components until it is called again.

    Args:
        model: The model.
        data: Its state; the applied generalised forces are written.
        bodies: The clusters, and (C,) the body of each.
        motion: The clusters' motion.
        components: The clusters of each component.
    """
    clusters, body_of = bodies
    centers = motion.centers_of_mass(clusters)
    data.qfrc_applied[:] = 0.0
    for c in (c for component in components for c in component):
        turn = motion.rotation[c]
        force = -clusters.linear_drag[c] * clusters.mass[c] * motion.velocity[c]
        slowed = clusters.inertia[c] @ (turn.T @ motion.spin[c])
        torque = -clusters.angular_drag[c] * (turn @ slowed)
        body = int(body_of[c])
        mujoco.mj_applyFT(model, data, force, torque, centers[c], body, data.qfrc_applied)
