"""Positions and rates of joints.

All of them are of a cluster relative to its parent, whichever of them the attached block is of.
In the machine frame every joint is at 0.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from buildarena_geometry.modules.joints import MOVING_JOINTS, Drive
from buildarena_simulation.engines.base import quaternion_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import axis_frame, cross, turn_about


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPlace:
    """Position and rate of a cluster on its joint.

    Attributes:
        place: One number for an axle, hinge (rad) or slider (units); a quaternion (w, x, y, z) for
            a ball; three angles for a constant-velocity joint, the last as large as the first.
        rate: One number, rad/s or units/s; a ball's spin (3,) in the cluster's machine axes; three
            rates.
    """

    place: FloatArray
    rate: FloatArray


def joint_type_of(structure: Structure, clusters: Clusters, c: int) -> str:
    """Return the attachment of a cluster to its parent."""
    attached = int(clusters.attached[c])
    return structure.parts[attached].physics.joint_type


def is_simple(structure: Structure, clusters: Clusters, c: int) -> bool:
    """Check if a cluster turns on an axle whose angle does not matter."""
    return bool(structure.joints.simple[clusters.attached[c]])


def has_joints(structure: Structure) -> bool:
    """Check if a machine has joints other than simple axles."""
    moving = np.array([part.physics.joint_type in MOVING_JOINTS for part in structure.parts])
    return bool((moving & ~structure.joints.simple).any())


def is_simple_component(structure: Structure, clusters: Clusters, component: Sequence[int]) -> bool:
    """Check if all joints of a component, root first, are axles whose angles do not matter."""
    return all(is_simple(structure, clusters, c) for c in component[1:])


def sign_of(clusters: Clusters, c: int) -> float:
    """Return 1 if the attached block moves with the cluster, -1 if it moves with the parent."""
    return 1.0 if clusters.attached_is_outer[c] else -1.0


def swing_axes(structure: Structure, clusters: Clusters, c: int) -> FloatArray:
    """Return the axes of a constant-velocity joint's three hinges, columns, machine frame, (3, 3).

    Turned by a, c and a about the first, second and first axis across its shaft, a body swings
    without twist: the third component of that quaternion along the shaft vanishes.
    """
    across = axis_frame(structure.joints.axes[clusters.attached[c]])[:, 1:]
    return np.column_stack([across[:, 0], across[:, 1], across[:, 0]])


def joint_rate(structure: Structure, clusters: Clusters, motion: Motion, c: int) -> float:
    """Return the speed at which a cluster turns on its axle or hinge, rad/s."""
    axis = motion.rotation[c] @ structure.joints.axes[clusters.attached[c]]
    return float((motion.spin[c] - motion.spin[clusters.parent[c]]) @ axis)


def joint_place(structure: Structure, clusters: Clusters, motion: Motion, c: int) -> JointPlace:
    """Return the position and rate of a cluster on its joint.

    Args:
        c: A cluster with a parent.
    """
    joint_type, parent = joint_type_of(structure, clusters, c), int(clusters.parent[c])
    axis = structure.joints.axes[clusters.attached[c]]
    turn = motion.rotation[parent].T @ motion.rotation[c]
    spin = motion.rotation[c].T @ (motion.spin[c] - motion.spin[parent])
    if joint_type == "slider":
        return _slide(clusters, motion, c, axis)
    quaternion = quaternion_of(turn)
    if joint_type == "ball":
        return JointPlace(place=quaternion, rate=spin)
    if joint_type == "constant_velocity":
        return _swing(quaternion, spin, swing_axes(structure, clusters, c))
    angle = 2.0 * np.arctan2(quaternion[1:] @ axis, quaternion[0])
    return JointPlace(place=np.array([angle]), rate=np.array([spin @ axis]))


def entered_place(
    structure: Structure,
    clusters: Clusters,
    motion: Motion,
    c: int,
    targets: FloatArray | None,
) -> JointPlace:
    """Return the initial position and rate of a cluster on its joint for an engine.

    Poses do not determine the number of turns of a joint; if its drive holds a position without
    limits, the turn nearest to that position is assumed.

    Args:
        c: A cluster with a parent.
        targets: (D,) last targets of the driven joints; None at the start.
    """
    current = joint_place(structure, clusters, motion, c)
    block = clusters.attached[c]
    joint = structure.parts[block].module.joint
    if targets is None or joint is None or joint.drive is None or joint.limits is not None:
        return current
    if joint.drive.kind == "position" and joint_type_of(structure, clusters, c) != "slider":
        target = targets[structure.joints.driven == block][0] * sign_of(clusters, c)
        turns = np.round((target - current.place) / (2.0 * np.pi))
        return JointPlace(place=current.place + 2.0 * np.pi * turns, rate=current.rate)
    return current


def driven_clusters(structure: Structure, clusters: Clusters) -> list[int]:
    """Return the clusters whose joints follow a target."""
    driven = []
    for c in np.flatnonzero(clusters.parent >= 0).tolist():
        module = structure.parts[clusters.attached[c]].module
        if module.motor is not None or (module.joint is not None and module.joint.drive):
            driven.append(c)
    return driven


def drive_of(structure: Structure, clusters: Clusters, c: int) -> Drive | None:
    """Return the drive of a driven cluster's joint; None for a wheel, which has a motor."""
    joint = structure.parts[clusters.attached[c]].module.joint
    return None if joint is None else joint.drive


def engaged(structure: Structure, clusters: Clusters) -> list[tuple[int, int, float]]:
    """Return pairs of clusters whose cogs mesh now, and the speed of the second per the first.

    Cogs engage as long as both turn on the same cluster. The speeds are those of the clusters
    against their parents.
    """
    place = {int(block): c for c, block in enumerate(clusters.attached) if block >= 0}
    base = clusters.cluster_of[structure.members.first]
    meshing = []
    for mesh in structure.joints.meshes:
        c, d = place.get(mesh.first), place.get(mesh.second)
        if c is None or d is None or base[clusters.joint[c]] != base[clusters.joint[d]]:
            continue
        meshing.append((c, d, mesh.ratio * sign_of(clusters, c) * sign_of(clusters, d)))
    return meshing


def _slide(clusters: Clusters, motion: Motion, c: int, axis: FloatArray) -> JointPlace:
    parent = int(clusters.parent[c])
    along = motion.rotation[parent] @ axis
    centers = motion.centers_of_mass(clusters)
    carried = cross(motion.spin[parent], centers[c] - centers[parent])
    speed = (motion.velocity[c] - motion.velocity[parent] - carried) @ along
    shift = (motion.position[c] - motion.position[parent]) @ along
    return JointPlace(place=np.array([shift]), rate=np.array([speed]))


def _swing(quaternion: FloatArray, spin: FloatArray, axes: FloatArray) -> JointPlace:
    first, second = axes[:, 0], axes[:, 1]
    w, x, y = quaternion[0], quaternion[1:] @ first, quaternion[1:] @ second
    a, c = float(np.arctan2(x, w)), 2.0 * math.asin(min(max(float(y), -1.0), 1.0))
    # The axes as the swung body sees them: each is turned back by the hinges after it.
    back = turn_about(first, -a)
    columns = np.column_stack([back @ turn_about(second, -c) @ first + first, back @ second])
    (of_first, of_second), *_ = np.linalg.lstsq(columns, spin, rcond=None)
    return JointPlace(place=np.array([a, c, a]), rate=np.array([of_first, of_second, of_first]))
