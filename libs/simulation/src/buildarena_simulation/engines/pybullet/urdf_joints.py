"""URDF text of the joint by which a cluster hangs on its parent."""

import numpy as np

from buildarena_simulation.engines.shared.joint_frames import (
    is_simple,
    seat_of,
    swing_axes,
)
from buildarena_simulation.structure.clusters import Clusters, limits_of
from buildarena_simulation.structure.model import FloatArray, Structure

_STRAIGHT = '<origin xyz="0 0 0" rpy="0 0 0"/>'
_BETWEEN_MASS, _BETWEEN_INERTIA = 1e-3, 0.02
"""Of a link between two hinges, mass and mass·unit²: a tenth of what a block has, as a solver by
iteration ties heavy links by light ones badly."""

_STRONG = 1e9
"""Effort and velocity that the format asks for, and that nothing reads."""


def joint_tags(
    structure: Structure,
    clusters: Clusters,
    c: int,
    *,
    names: tuple[str, str],
    origin: str,
    body_from_machine: FloatArray,
) -> list[str]:
    """The joint of a cluster; of a constant-velocity joint three, with the links between them.

    Args:
        structure: The machine.
        clusters: Its clusters.
        c: The cluster.
        names: Of its parent's link and of its own.
        origin: Tag of its link's frame in its parent's, at place 0.
        body_from_machine: (3, 3) into its link's axes.
    """
    number = names[1].removeprefix("link ")
    if is_simple(structure, clusters, c):
        axis = body_from_machine @ structure.joints.axes[clusters.seated[c]]
        return _joint(f"hinge {number}", "continuous", names, origin, axis)
    seat, limits = seat_of(structure, clusters, c), limits_of(structure, clusters, c)
    axis = body_from_machine @ structure.joints.axes[clusters.seated[c]]
    if seat == "constant_velocity":
        return _halves(
            names, origin, body_from_machine @ swing_axes(structure, clusters, c), limits
        )
    kind = {"slider": "prismatic", "ball": "spherical"}.get(seat, "revolute")
    return _joint(f"joint {number}", kind, names, origin, axis, limits=limits)


def links_before(structure: Structure, clusters: Clusters, c: int, name: str) -> list[str]:
    """The small links that a cluster's joint needs before its own: an engine wants parents first.

    Args:
        structure: The machine.
        clusters: Its clusters.
        c: The cluster.
        name: Of its own link.
    """
    if seat_of(structure, clusters, c) != "constant_velocity":
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
    """Numbers of an attribute, written in full."""
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
