"""URDF text of one articulated component.

Each link's inertial frame is the principal frame of its cluster. A newline follows every tag: long
URDF lines fail to parse.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from buildarena_simulation.engines.shared.joint_frames import is_simple, joint_type_of, swing_axes
from buildarena_simulation.structure.clusters import Clusters, limits_of
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
    """Return the URDF of a component whose joints are all at 0 in the machine frame.

    Args:
        solids: Collision shapes of the component's clusters, its root first.
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
            origins[c] = structure.joints.points[clusters.attached[c]]
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
    """Return the fixed-axis angles of a rotation, R = Rz(yaw) · Ry(pitch) · Rx(roll)."""
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    if np.hypot(r[0, 0], r[1, 0]) < 1e-9:  # noqa: PLR2004 - straight up or down: roll is free
        return np.array([np.arctan2(-r[1, 2], r[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])])


_STRAIGHT = '<origin xyz="0 0 0" rpy="0 0 0"/>'
_BETWEEN_MASS, _BETWEEN_INERTIA = 1e-3, 0.02
"""Mass and inertia of a link between two hinges, mass·unit²: a tenth of a block's: an
iterative solver couples heavy links badly by light ones."""

_STRONG = 1e9
"""Effort and velocity that the format requires and PyBullet ignores."""


def joint_tags(
    structure: Structure,
    clusters: Clusters,
    c: int,
    *,
    names: tuple[str, str],
    origin: str,
    body_from_machine: FloatArray,
) -> list[str]:
    """Return the tags of a cluster's joint; a constant-velocity joint has three, linked.

    Args:
        c: Cluster.
        names: Names of its parent's link and of its own.
        origin: Tag of its link's frame in its parent's, at position 0.
        body_from_machine: (3, 3) into its link's axes.
    """
    number = names[1].removeprefix("link ")
    if is_simple(structure, clusters, c):
        axis = body_from_machine @ structure.joints.axes[clusters.attached[c]]
        return _joint(f"hinge {number}", "continuous", names, origin, axis)
    joint_type, limits = joint_type_of(structure, clusters, c), limits_of(structure, clusters, c)
    axis = body_from_machine @ structure.joints.axes[clusters.attached[c]]
    if joint_type == "constant_velocity":
        return _halves(
            names, origin, body_from_machine @ swing_axes(structure, clusters, c), limits
        )
    kind = {"slider": "prismatic", "ball": "spherical"}.get(joint_type, "revolute")
    return _joint(f"joint {number}", kind, names, origin, axis, limits=limits)


def links_before(structure: Structure, clusters: Clusters, c: int, name: str) -> list[str]:
    """Return the tags of the small links before a cluster's own; an engine requires parents first.

    Args:
        c: Cluster.
        name: Name of its own link.
    """
    if joint_type_of(structure, clusters, c) != "constant_velocity":
        return []
    i = _BETWEEN_INERTIA
    inertia = f'ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"'
    lines: list[str] = []
    for between in _between(name):
        lines += [
            f'<link name="{between}">',
            "<inertial>",
            _STRAIGHT,
            f'<mass value="{_BETWEEN_MASS}"/>',
            f"<inertia {inertia}/>",
            "</inertial>",
            "</link>",
        ]
    return lines


def _between(name: str) -> list[str]:
    return [f"{name} between {k}" for k in (0, 1)]


def numbers(values: FloatArray) -> str:
    """Return the numbers of an attribute with all their digits."""
    return " ".join(repr(float(v)) for v in values)


def _halves(
    names: tuple[str, str],
    origin: str,
    axes: FloatArray,
    limits: tuple[float, float] | None,
) -> list[str]:
    parent, child = names
    chain = [parent, *_between(child), child]
    lines: list[str] = []
    for k in range(3):
        # The outer hinges turn by half of what the shaft bends.
        share = 1.0 if k == 1 else 0.5
        within = None if limits is None else (share * limits[0], share * limits[1])
        place = origin if k == 0 else _STRAIGHT
        link = (chain[k], chain[k + 1])
        lines += _joint(f"{chain[k + 1]} joint", "revolute", link, place, axes[:, k], limits=within)
    return lines


def _joint(
    name: str,
    kind: str,
    names: tuple[str, str],
    origin: str,
    axis: FloatArray,
    *,
    limits: tuple[float, float] | None = None,
) -> list[str]:
    if kind == "revolute" and limits is None:
        kind = "continuous"
    # Limits the wrong way round are none.
    low, high = (1.0, -1.0) if limits is None else limits
    bounds = f'lower="{float(low)!r}" upper="{float(high)!r}"'
    limit = f'<limit {bounds} effort="{_STRONG}" velocity="{_STRONG}"/>'
    return [
        f'<joint name="{name}" type="{kind}">',
        f'<parent link="{names[0]}"/>',
        f'<child link="{names[1]}"/>',
        origin,
        f'<axis xyz="{numbers(np.asarray(axis))}"/>',
        *([limit] if kind in ("revolute", "prismatic") else []),
        "</joint>",
    ]
