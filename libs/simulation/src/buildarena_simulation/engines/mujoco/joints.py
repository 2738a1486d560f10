"""Moving joints in a compiled MuJoCo model: where they start, and the targets of their drives."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from buildarena_simulation.engines.base import quaternion_of, rotation_of
from buildarena_simulation.engines.shared.joint_frames import (
    drive_of,
    driven_clusters,
    entered_place,
    is_simple,
    joint_rate,
    joint_type_of,
    sign_of,
)
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAddresses:
    """Driven joints of a compiled model: P that hold a position, V that hold a speed.

    Attributes:
        placed: (P,) row of each in the structure's driven joints.
        place_signs: (P,) -1 where the moved body is the base's instead of the attached block's.
        actuators: (P,) actuator of each.
        turned: (V,) as `placed`.
        turn_signs: (V,) as `place_signs`.
        rotors: (V,) velocity of each motor's rotor.
        clutches: (V,) tendon of each.
        torques: (V,) maximum of each, mass·unit²/s² (a slider's, mass·unit/s²).
        frees: True if some turn freely at times.
    """

    placed: IntArray
    place_signs: FloatArray
    actuators: IntArray
    turned: IntArray
    turn_signs: FloatArray
    rotors: IntArray
    clutches: IntArray
    torques: FloatArray
    frees: bool

    def follow(self, model: "mujoco.MjModel", data: "mujoco.MjData", row: FloatArray) -> None:
        """Set the targets of the drives.

        Args:
            row: (D,) row of `Schedule.targets`.
        """
        if len(self.placed):
            data.ctrl[self.actuators] = row[self.placed] * self.place_signs
        if len(self.turned):
            speeds = row[self.turned] * self.turn_signs
            if self.frees:
                free = np.isnan(speeds)
                model.tendon_frictionloss[self.clutches] = np.where(free, 0.0, self.torques)
                speeds[free] = 0.0
            data.qvel[self.rotors] = speeds


def joint_addresses(
    model: "mujoco.MjModel", structure: Structure, clusters: Clusters
) -> JointAddresses:
    """Find the driven joints in a compiled model."""
    number = {int(block): d for d, block in enumerate(structure.joints.driven)}
    inside = driven_clusters(structure, clusters)
    drives = {c: drive_of(structure, clusters, c) for c in inside}
    places = [c for c, drive in drives.items() if drive and drive.kind == "position"]
    speeds = [c for c in inside if c not in places]
    clutches = _whole(model.tendon(f"clutch {c}").id for c in speeds)
    return JointAddresses(
        placed=_whole(number[int(clusters.attached[c])] for c in places),
        place_signs=np.array([sign_of(clusters, c) for c in places]),
        actuators=_whole(model.actuator(f"hinge {c}").id for c in places),
        turned=_whole(number[int(clusters.attached[c])] for c in speeds),
        turn_signs=np.array([sign_of(clusters, c) for c in speeds]),
        rotors=_whole(model.joint(f"rotor {c}").dofadr[0] for c in speeds),
        clutches=clutches,
        torques=model.tendon_frictionloss[clutches].copy(),
        frees=any(drive and drive.default_mode == "free" for drive in drives.values()),
    )


def _whole(numbers: Iterable[int]) -> IntArray:
    return np.array([int(number) for number in numbers], dtype=np.int64)


def enter_joint(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    bodies: tuple[Structure, Clusters, FloatArray],
    motion: Motion,
    *,
    c: int,
    targets: FloatArray | None,
) -> None:
    """Set a cluster's joint to the position and the rate that the cluster's motion implies.

    Args:
        data: Its state, changed in place.
        bodies: The machine, its clusters, and (C, 3, 3) machine_from_principal.
        c: Cluster.
        targets: (D,) last targets of the driven joints; None at the start.
    """
    structure, clusters, axes = bodies
    joint = model.joint(f"hinge {c}")
    if is_simple(structure, clusters, c):
        data.qvel[joint.dofadr[0]] = joint_rate(structure, clusters, motion, c)
        return
    joint_type = joint_type_of(structure, clusters, c)
    entered = entered_place(structure, clusters, motion, c, targets)
    place, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
    if joint_type == "ball":
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
    """Apply the drag of every cluster of some components until the next call.

    Args:
        data: Its state; the applied generalised forces are written.
        bodies: The clusters, and (C,) the body of each.
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
