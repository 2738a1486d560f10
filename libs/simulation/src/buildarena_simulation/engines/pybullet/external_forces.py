"""Thrust, drag and the blocks' own forces as steady ones in the frames of an engine's bodies.

Both change little from one evaluation to the next, so they are worked out once for the steps
between; given in a body's own principal frame, they turn with it.
"""

import numpy as np

from buildarena_simulation.engines.shared.joint_frames import is_simple_component
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import turned_wrenches

Force = tuple[list[float], list[float]]
"""A force and the point it acts on, or a force and a torque about the centre of mass."""


def thrust_forces(
    structure: Structure, clusters: Clusters, axes: FloatArray, thrusts: FloatArray
) -> list[tuple[int, Force]]:
    """Return cluster, force and point of each cannon that fires.

    Args:
        axes: (C, 3, 3) machine_from_principal.
        thrusts: (C,) recoil of each cannon, mass·unit/s².
    """
    forces = []
    for cannon in np.flatnonzero(thrusts):
        block = structure.cannons[cannon]
        c = int(clusters.cluster_of[block])
        to_body = axes[c].T
        arm = to_body @ (structure.thrust_points[cannon] - clusters.center_of_mass[c])
        force = -thrusts[cannon] * (to_body @ structure.directions[block])
        forces.append((c, (force.tolist(), arm.tolist())))
    return forces


def drag_forces(
    structure: Structure, clusters: Clusters, motion: Motion, axes: FloatArray, moments: FloatArray
) -> list[tuple[int, Force]]:
    """Return cluster, force and torque of the drag: Unity's v *= 1 - drag·dt as a force.

    A component with no joints but wheels' axles moves as its root does, which takes the drag of
    all; in any other each cluster has its own.

    Args:
        axes: (C, 3, 3) machine_from_principal.
        moments: (C, 3) principal moments of inertia.
    """
    forces = []
    for component in clusters.components:
        if not is_simple_component(structure, clusters, component):
            forces += [(c, _own_drag(clusters, motion, axes, moments, c=c)) for c in component]
            continue
        root, inside = component[0], list(component)
        to_body = (motion.rotation[root] @ axes[root]).T
        drag = float(clusters.linear_drag[inside] @ clusters.mass[inside])
        force = -drag * (to_body @ motion.velocity[root])
        torque = -clusters.angular_drag[root] * moments[root] * (to_body @ motion.spin[root])
        forces.append((root, (force.tolist(), torque.tolist())))
    return forces


def body_wrenches(wrenches: FloatArray, axes: FloatArray) -> list[tuple[int, Force]]:
    """Return the cluster, force and torque of each cluster that a wrench acts on.

    Args:
        wrenches: (C, 6) about the centres of mass, machine frame axes.
        axes: (C, 3, 3) machine_from_principal.
    """
    local = turned_wrenches(axes.transpose(0, 2, 1), wrenches)
    acted_on = np.flatnonzero(wrenches.any(axis=1))
    return [(int(c), (local[c, :3].tolist(), local[c, 3:].tolist())) for c in acted_on]


def _own_drag(
    clusters: Clusters, motion: Motion, axes: FloatArray, moments: FloatArray, *, c: int
) -> Force:
    to_body = (motion.rotation[c] @ axes[c]).T
    drag = clusters.linear_drag[c] * clusters.mass[c]
    force = -drag * (to_body @ motion.velocity[c])
    torque = -clusters.angular_drag[c] * moments[c] * (to_body @ motion.spin[c])
    return force.tolist(), torque.tolist()
