"""URDF text of one articulated component.

Each link's inertial frame is the principal frame of its cluster. A newline follows every tag: long
URDF lines fail to parse.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from buildarena_simulation.engines.pybullet.urdf_joints import joint_tags, links_before, numbers
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, ShapeKind, Structure
from buildarena_simulation.structure.solids import Solid


def urdf_of(
    structure: Structure,
    clusters: Clusters,
    solids: Mapping[int, Sequence[Solid]],
    *,
    axes: FloatArray,
    moments: FloatArray,
) -> str:
    """The URDF of a component whose joints are all at 0 in the machine frame.

    Args:
        structure: The machine.
        clusters: Its clusters.
        solids: The collision shapes of the component's clusters, its root first.
        axes: (C, 3, 3) machine_from_principal.
        moments: (C, 3) principal moments of inertia.
    """
    inside = list(solids)
    root = inside[0]
    # A link's frame is at its hinge; the root's, at its centre of mass.
    origins = {root: clusters.center_of_mass[root]}
    lines = ['<robot name="piece">']
    for link, c in enumerate(inside):
        if link:
            origins[c] = structure.joints.points[clusters.seated[c]]
            lines += links_before(structure, clusters, c, f"link {link}")
        offset = axes[c].T @ (clusters.center_of_mass[c] - origins[c])
        lines += [f'<link name="link {link}">', *_inertial(clusters.mass[c], moments[c], offset)]
        for solid in solids[c]:
            place = axes[c].T @ (solid.center - origins[c])
            lines += _collision(solid, place, axes[c].T @ solid.rotation)
        lines.append("</link>")
    for link, c in enumerate(inside[1:], 1):
        parent = int(clusters.parent[c])
        place = axes[parent].T @ (origins[c] - origins[parent])
        lines += joint_tags(
            structure,
            clusters,
            c,
            names=(f"link {inside.index(parent)}", f"link {link}"),
            origin=_origin(place, axes[parent].T @ axes[c]),
            body_from_machine=axes[c].T,
        )
    lines.append("</robot>")
    return "\n".join(lines) + "\n"


def _inertial(mass: float, moments: FloatArray, offset: FloatArray) -> list[str]:
    a, b, c = moments.tolist()
    return [
        "<inertial>",
        f'<origin xyz="{numbers(offset)}" rpy="0 0 0"/>',
        f'<mass value="{float(mass)!r}"/>',
        f'<inertia ixx="{a!r}" ixy="0" ixz="0" iyy="{b!r}" iyz="0" izz="{c!r}"/>',
        "</inertial>",
    ]


def _collision(solid: Solid, place: FloatArray, rotation: FloatArray) -> list[str]:
    half = solid.half_extents
    if solid.kind is ShapeKind.CYLINDER:
        form = f'<cylinder radius="{float(half[0])!r}" length="{float(2 * half[2])!r}"/>'
    elif solid.kind is ShapeKind.SPHERE:
        form = f'<sphere radius="{float(half[0])!r}"/>'
    else:
        form = f'<box size="{numbers(2 * half)}"/>'
    return [
        "<collision>",
        _origin(place, rotation),
        "<geometry>",
        form,
        "</geometry>",
        "</collision>",
    ]


def _origin(place: FloatArray, rotation: FloatArray) -> str:
    return f'<origin xyz="{numbers(place)}" rpy="{numbers(_roll_pitch_yaw(rotation))}"/>'


def _roll_pitch_yaw(r: FloatArray) -> FloatArray:
    """Fixed-axis angles of a rotation, R = Rz(yaw) · Ry(pitch) · Rx(roll)."""
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    if np.hypot(r[0, 0], r[1, 0]) < 1e-9:  # noqa: PLR2004 - straight up or down: roll is free
        return np.array([np.arctan2(-r[1, 2], r[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])])
