"""Rigid clusters, the moving joints between them, and their mass properties.

Blocks joined rigidly form a *cluster*; clusters joined by moving joints (axles, hinges, sliders, …)
form an articulated *component*, a tree whose root is its largest cluster, or its heaviest where
more than wheels moves.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_geometry.modules.joints import MOVING_JOINTS
from buildarena_simulation.constants import JointKind
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    BoolArray,
    FloatArray,
    IntArray,
    Structure,
)

_MOVING: Final = [JOINT_KINDS.index(JointKind(seat)) for seat in MOVING_JOINTS]
_TURNING: Final = [JOINT_KINDS.index(kind) for kind in (JointKind.AXLE, JointKind.HINGE)]
_COLLINEAR: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Clusters:
    """Rigid groups of a structure's blocks; C clusters, parents before children.

    Attributes:
        cluster_of: (N,) cluster of each block.
        blocks: Per cluster, the indices of its blocks in ascending order.
        parent: (C,) cluster that its joint attaches it to, -1 for a component's root.
        joint: (C,) the member that is this joint, -1 for a root.
        attached: (C,) block attached by this joint (a wheel, a hinge, …), -1 for a root.
        attached_is_outer: (C,) true if that block belongs to this cluster, false if to its parent.
        root: (C,) root cluster of its component.
        level: (C,) number of joints between it and its root.
        mass: (C,) mass units.
        center_of_mass: (C, 3) machine frame, units.
        inertia: (C, 3, 3) about the centre of mass, machine frame axes.
        linear_drag: (C,) mass-weighted mean over the cluster, 1/s.
        angular_drag: (C,) mass-weighted mean over the cluster, 1/s.
    """

    cluster_of: IntArray
    blocks: tuple[IntArray, ...]
    parent: IntArray
    joint: IntArray
    attached: IntArray
    attached_is_outer: BoolArray
    root: IntArray
    level: IntArray
    mass: FloatArray
    center_of_mass: FloatArray
    inertia: FloatArray
    linear_drag: FloatArray
    angular_drag: FloatArray

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def components(self) -> tuple[tuple[int, ...], ...]:
        """Clusters of each component, its root first."""
        roots = np.flatnonzero(self.parent < 0)
        return tuple(tuple(np.flatnonzero(self.root == root).tolist()) for root in roots)


def find_clusters(structure: Structure, holds: BoolArray) -> Clusters:
    """Return the clusters of a structure some of whose members hold.

    A moving joint whose two sides are held together otherwise (a brace across it) is rigid. One
    that closes a loop of clusters is redundant if both it and the one it doubles turn about the
    same line; else the loop is rigid.

    Args:
        holds: (M,) true for members that still hold.

    Returns:
        The clusters, ordered by component (first block), parents before children.
    """
    members = structure.members
    moving = np.isin(members.kind, _MOVING)
    rigid = list(np.flatnonzero(holds & ~moving).tolist())
    joints = np.flatnonzero(holds & moving).tolist()
    while True:
        groups = connected_components(
            len(structure), ((members.first[k], members.second[k]) for k in rigid)
        )
        label = _labels(len(structure), groups)
        free = [k for k in joints if label[members.first[k]] != label[members.second[k]]]
        tree, locked = _grow_trees(structure, groups, label, free)
        locked += _held_by_teeth(structure, label, free)
        if not locked:
            return _collect(structure, groups, tree)
        rigid.extend(locked)


def _held_by_teeth(structure: Structure, label: Sequence[int], free: Sequence[int]) -> list[int]:
    """Return the joints of cogs that mesh with one fixed to their common base."""
    members = structure.members
    joint_of = {int(members.second[k]): k for k in free}
    held = []
    for mesh in structure.joints.meshes:
        for cog, other in ((mesh.first, mesh.second), (mesh.second, mesh.first)):
            k = joint_of.get(cog)
            if k is not None and other not in joint_of and label[members.first[k]] == label[other]:
                held.append(k)
    return held


def limits_of(structure: Structure, clusters: Clusters, c: int) -> tuple[float, float] | None:
    """Return the minimum and maximum of a cluster's joint; None if it has no limits."""
    joint = structure.parts[clusters.attached[c]].module.joint
    if joint is None or joint.limits is None:
        return None
    low, high = joint.limits
    return (low, high) if clusters.attached_is_outer[c] else (-high, -low)


def connected_components(count: int, edges: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return connected components of a graph, each ascending, ordered by their smallest node."""
    leader = list(range(count))

    def find(i: int) -> int:
        while leader[i] != i:
            leader[i] = leader[leader[i]]
            i = leader[i]
        return i

    for a, b in edges:
        low, high = sorted((find(int(a)), find(int(b))))
        leader[high] = low
    groups: dict[int, list[int]] = {}
    for i in range(count):
        groups.setdefault(find(i), []).append(i)
    return list(groups.values())


def _labels(count: int, groups: Sequence[Sequence[int]]) -> list[int]:
    label = [0] * count
    for g, blocks in enumerate(groups):
        for i in blocks:
            label[i] = g
    return label


_Tree = list[tuple[int, int, int]]
"""(group, parent group or -1, joint or -1), parents first."""


def _grow_trees(
    structure: Structure,
    groups: Sequence[Sequence[int]],
    label: Sequence[int],
    joints: Sequence[int],
) -> tuple[_Tree, list[int]]:
    """Return the spanning trees of the groups along joints, and the joints that lock a loop."""
    members = structure.members
    edges = [(label[members.first[k]], label[members.second[k]]) for k in joints]
    tree: _Tree = []
    via: dict[int, int] = {}
    for component in connected_components(len(groups), edges):
        inside = [k for k, (a, _) in zip(joints, edges, strict=True) if a in component]
        root = _root(structure, groups, component, inside)
        reached = {root}
        tree.append((root, -1, -1))
        waiting = [root]
        while waiting:
            current = waiting.pop(0)
            for k, (a, b) in zip(joints, edges, strict=True):
                if current not in (a, b):
                    continue
                other = b if a == current else a
                if other not in reached:
                    reached.add(other)
                    via[other] = k
                    tree.append((other, current, k))
                    waiting.append(other)
    parent = {group: up for group, up, _ in tree}
    locked = []
    for k, (a, b) in zip(joints, edges, strict=True):
        if via.get(a) == k or via.get(b) == k:
            continue
        doubled = via[a] if parent[a] == b else via[b] if parent[b] == a else None
        if doubled is None or not _collinear(structure, k, doubled):
            locked.extend([k, *_path(parent, via, a, b)])
    return tree, locked


def _root(
    structure: Structure,
    groups: Sequence[Sequence[int]],
    component: Sequence[int],
    joints: Sequence[int],
) -> int:
    """Return the root group of a component's tree.

    If only wheels move, it is the one with most blocks. Otherwise it is the heaviest: a joint's
    load is computed from the motion of the outer side, and an error of the heavier side's would
    outweigh the lighter one's loads.
    """
    simple = structure.joints.simple[structure.members.second[list(joints)]].all()
    if simple:
        return max(component, key=lambda g: (len(groups[g]), -g))
    return max(component, key=lambda g: (round(float(structure.masses[groups[g]].sum()), 9), -g))


def _path(parent: dict[int, int], via: dict[int, int], a: int, b: int) -> list[int]:
    """Return the joints on the tree path between two groups."""
    up_a, up_b = [a], [b]
    for line in (up_a, up_b):
        while parent[line[-1]] >= 0:
            line.append(parent[line[-1]])
    meeting = next(g for g in up_a if g in set(up_b))
    return [via[g] for line in (up_a, up_b) for g in line[: line.index(meeting)]]


def _collinear(structure: Structure, k: int, other: int) -> bool:
    if not np.isin(structure.members.kind[[k, other]], _TURNING).all():
        return False
    attached = structure.members.second[[k, other]]
    first, second = structure.joints.axes[attached]
    offset = structure.joints.points[attached[1]] - structure.joints.points[attached[0]]
    return bool(
        np.linalg.norm(np.cross(first, second)) < _COLLINEAR
        and np.linalg.norm(np.cross(first, offset)) < _COLLINEAR
    )


def _collect(structure: Structure, groups: Sequence[Sequence[int]], tree: _Tree) -> Clusters:
    place = {group: c for c, (group, _, _) in enumerate(tree)}
    blocks = tuple(np.array(groups[group], dtype=np.int64) for group, _, _ in tree)
    parent = np.array([place.get(up, -1) for _, up, _ in tree], dtype=np.int64)
    joint = np.array([k for _, _, k in tree], dtype=np.int64)
    cluster_of = np.zeros(len(structure), dtype=np.int64)
    for c, ids in enumerate(blocks):
        cluster_of[ids] = c
    root, level = np.arange(len(tree)), np.zeros(len(tree), dtype=np.int64)
    for c, up in enumerate(parent):
        if up >= 0:
            root[c], level[c] = root[up], level[up] + 1
    attached = np.where(
        joint >= 0, structure.members.second[joint] if len(structure.members) else -1, -1
    )
    mass, center, inertia = _mass_properties(structure, blocks)
    return Clusters(
        cluster_of=cluster_of,
        blocks=blocks,
        parent=parent,
        joint=joint,
        attached=attached,
        attached_is_outer=(attached >= 0) & (cluster_of[attached] == np.arange(len(tree))),
        root=root,
        level=level,
        mass=mass,
        center_of_mass=center,
        inertia=inertia,
        linear_drag=np.array([structure.linear_drag[i] @ structure.masses[i] for i in blocks])
        / mass,
        angular_drag=np.array([structure.angular_drag[i] @ structure.masses[i] for i in blocks])
        / mass,
    )


def _mass_properties(
    structure: Structure, clusters: Sequence[IntArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    mass = np.array([structure.masses[ids].sum() for ids in clusters])
    center = (
        np.array([structure.masses[ids] @ structure.centers_of_mass[ids] for ids in clusters])
        / mass[:, None]
    )
    inertia = np.empty((len(clusters), 3, 3))
    for c, ids in enumerate(clusters):
        r = structure.centers_of_mass[ids] - center[c]
        m = structure.masses[ids]
        inertia[c] = (
            structure.inertias[ids].sum(axis=0)
            + (m * (r * r).sum(axis=1)).sum() * np.eye(3)
            - (m[:, None] * r).T @ r
        )
    return mass, center, inertia
