"""Which joints of a machine can move as it is built, which cogs mesh, and what locks the rest.

Simulators find the same: blocks held together rigidly are one body; a joint between two sides of
one body does not move; joints that close a loop of bodies lock it, unless they turn about one line.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

from buildarena_geometry.blocks import Block
from buildarena_geometry.modules.joints import MESH_COSINE, MESH_SLACK, MOVING_JOINTS, MovingJoint
from buildarena_geometry.modules.solids import Cylinder
from buildarena_geometry.rotations import Vector, add, cross, dot, scaled, subtract
from buildarena_geometry.state import MachineState

FLUSH_TOLERANCE = 0.05
"""A far end that comes so near another block's face is joined to it, units."""
_OPPOSITE = 1.0 - 1e-3  # cosine; faces that look at each other
_COLLINEAR = 1e-3
_TURNING = ("axle", "hinge")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mobility:
    """What of a machine's joints comes of how it is built.

    Attributes:
        meshes: by cog, the cogs that it drives or is driven by.
        locks: by block whose joint cannot move, the parts that lock it: connectors, far ends, cogs,
            or the joints of the loop that it is in.
    """

    meshes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    locks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class _Edge(NamedTuple):
    """What holds two blocks together."""

    first: str  # id of the base
    second: str  # id of the block that sits on it, or of a connector's other end
    by: str = ""  # what is named as holding them; "" for an ordinary attachment


def mobility(state: MachineState) -> Mobility:
    """What can move in a machine, and what meshes."""
    if not any(_moves(block) for block in state.blocks.values()):
        return Mobility()
    rigid, joints = _edges(state)
    meshes = [way for pair in _touching_cogs(state) for way in (pair, pair[::-1])]
    locks: dict[str, tuple[str, ...]] = {}
    while True:
        label = _labels(state.blocks, rigid)
        free = [edge for edge in joints if label[edge.first] != label[edge.second]]
        for edge in joints:
            if edge.second not in locks and label[edge.first] == label[edge.second]:
                locks[edge.second] = _holding(rigid, edge)
        newly_locked = {**_closed_loops(state, label, free), **_held_teeth(label, free, meshes)}
        if not newly_locked:
            return Mobility(meshes=_driving(label, free, meshes), locks=locks)
        locks.update(newly_locked)
        rigid += [_Edge(e.first, e.second, e.second) for e in free if e.second in newly_locked]


def _joint_type(block: Block) -> str | None:
    return None if block.module.physics is None else block.module.physics.joint_type


def _moves(block: Block) -> bool:
    return _joint_type(block) in MOVING_JOINTS


def _edges(state: MachineState) -> tuple[list[_Edge], list[_Edge]]:
    """What holds rigidly, and the joints that may move."""
    rigid: list[_Edge] = []
    joints: list[_Edge] = []
    for joint in state.joints():
        part = state.blocks[joint.part]
        if joint.holds and part.module.rope_mount is None and not part.module.is_loose:
            (joints if _moves(part) else rigid).append(_Edge(joint.base, joint.part))
    rigid += [
        _Edge(*link.ends, link.id)
        for link in state.connectors.values()
        if link.module.link == "rigid"
    ]
    joined = {frozenset((edge.first, edge.second)) for edge in (*rigid, *joints) if not edge.by}
    return [*rigid, *_far_ends(state, joined)], joints


def _far_ends(state: MachineState, joined: set[frozenset[str]]) -> Iterator[_Edge]:
    """Blocks whose far end lies flush on a block of the frame, and is joined to it."""
    holders = [
        (block, _shape(block), math.hypot(*_half(block)) + FLUSH_TOLERANCE)
        for block in state.blocks.values()
        if block.module.physics is not None and block.module.physics.structural
    ]
    for block in state.blocks.values():
        if not block.module.grabs:
            continue
        outward = block.axis_xyz
        tip = add(_shape(block)[0], scaled(outward, _half(block)[2]))
        for holder, (center, axes), reach in holders:
            apart = subtract(tip, center)
            if dot(apart, apart) > reach * reach or holder is block:
                continue
            pair = frozenset((block.id, holder.id))
            if pair not in joined and _is_flush(apart, outward, axes, _half(holder)):
                joined.add(pair)
                yield _Edge(block.id, holder.id, block.id)


def _is_flush(apart: Vector, outward: Vector, axes: Sequence[Vector], half: Vector) -> bool:
    local = [dot(apart, axis) for axis in axes]
    facing = [dot(outward, axis) for axis in axes]
    if any(abs(x) > h + FLUSH_TOLERANCE for x, h in zip(local, half, strict=True)):
        return False
    return any(
        abs(f) > _OPPOSITE and abs(x + math.copysign(h, f)) <= FLUSH_TOLERANCE
        for x, f, h in zip(local, facing, half, strict=True)
    )


def _shape(block: Block) -> tuple[Vector, tuple[Vector, Vector, Vector]]:
    """The middle of a block's first solid and that solid's axes, world frame."""
    solid, pose = block.module.body[0], block.world_from_block
    turned = pose @ solid.block_from_axis if isinstance(solid, Cylinder) else pose
    x, y, z = map(turned.direction, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    return pose.point(solid.center), (x, y, z)


def _half(block: Block) -> Vector:
    """Half the extents of a block's first solid along its axes, units."""
    solid = block.module.body[0]
    if isinstance(solid, Cylinder):
        return (solid.radius, solid.radius, solid.length / 2)
    x, y, z = solid.size
    return (x / 2, y / 2, z / 2)


def _touching_cogs(state: MachineState) -> Iterator[tuple[str, str]]:
    """Cogs with parallel axes, beside each other, whose pitch circles touch."""
    cogs = [
        (block, block.module.gear.pitch_radius, *_shape(block))
        for block in state.blocks.values()
        if block.module.gear is not None
    ]
    for (a, radius_a, center_a, _), (b, radius_b, center_b, _) in combinations(cogs, 2):
        axis = _axis(a)
        apart = subtract(center_b, center_a)
        along = dot(apart, axis)
        across = math.hypot(*subtract(apart, scaled(axis, along)))
        if (
            abs(across - radius_a - radius_b) <= MESH_SLACK
            and abs(dot(axis, _axis(b))) >= MESH_COSINE
            and abs(along) < _half(a)[2] + _half(b)[2] - MESH_SLACK
        ):
            yield a.id, b.id


def _axis(block: Block) -> Vector:
    joint = block.module.joint or MovingJoint()
    return block.world_from_block.direction(joint.axis)


def _pivot(block: Block) -> Vector:
    joint = block.module.joint
    if joint is not None and joint.point is not None:
        return block.world_from_block.point(joint.point)
    return block.body_center_xyz


def _labels(blocks: Iterable[str], edges: Iterable[_Edge]) -> dict[str, str]:
    """The rigid body of each block, by the id of one block of it."""
    leader = {block: block for block in blocks}

    def find(block: str) -> str:
        while leader[block] != block:
            leader[block] = leader[leader[block]]
            block = leader[block]
        return block

    for edge in edges:
        leader[find(edge.second)] = find(edge.first)
    return {block: find(block) for block in leader}


def _holding(rigid: Sequence[_Edge], joint: _Edge) -> tuple[str, ...]:
    """What is named on the shortest rigid way from one side of a joint to the other."""
    neighbours = defaultdict[str, list[tuple[str, str]]](list)
    for first, second, by in rigid:
        neighbours[first].append((second, by))
        neighbours[second].append((first, by))
    came: dict[str, tuple[str, str]] = {joint.first: ("", "")}
    waiting = [joint.first]
    for current in waiting:
        for other, by in neighbours[current]:
            if other not in came:
                came[other] = (current, by)
                waiting.append(other)
    named, block = [], joint.second
    while block != joint.first:
        block, by = came[block]
        named.append(by)
    return tuple(dict.fromkeys(by for by in reversed(named) if by and by != joint.second))


def _closed_loops(
    state: MachineState, label: Mapping[str, str], free: Sequence[_Edge]
) -> dict[str, tuple[str, ...]]:
    """The joints of loops that cannot move, with the others of their loop."""
    mass = dict.fromkeys(label.values(), 0.0)
    for part in state.blocks.values():
        mass[label[part.id]] += part.module.mass
    up = _trees(mass, label, free)
    tree = {edge for _, edge in up.values()}
    locked: dict[str, tuple[str, ...]] = {}
    for edge in free:
        if edge in tree:
            continue
        path = _path(up, label[edge.first], label[edge.second])
        if len(path) == 1 and _collinear(state, edge, path[0]):
            continue
        loop = [edge.second, *(other.second for other in path)]
        for block in loop:
            locked.setdefault(block, tuple(other for other in loop if other != block))
    return locked


def _trees(
    mass: Mapping[str, float], label: Mapping[str, str], free: Sequence[_Edge]
) -> dict[str, tuple[str, _Edge]]:
    """Trees of bodies along joints, from the heaviest out: by body, what it hangs on and how."""
    up: dict[str, tuple[str, _Edge]] = {}
    reached: set[str] = set()
    for root in sorted(mass, key=lambda body: -mass[body]):
        waiting = [] if root in reached else [root]
        reached.add(root)
        for current in waiting:
            for edge in free:
                ends = (label[edge.first], label[edge.second])
                other = ends[1] if ends[0] == current else ends[0]
                if current in ends and other not in reached:
                    reached.add(other)
                    up[other] = (current, edge)
                    waiting.append(other)
    return up


def _path(up: Mapping[str, tuple[str, _Edge]], a: str, b: str) -> list[_Edge]:
    """The joints of the tree between two bodies."""
    ways = [_upwards(up, body) for body in (a, b)]
    # From the root on, the two ways are one until they part.
    while ways[0] and ways[1] and ways[0][-1] is ways[1][-1]:
        del ways[0][-1], ways[1][-1]
    return [*ways[0], *ways[1]]


def _upwards(up: Mapping[str, tuple[str, _Edge]], body: str) -> list[_Edge]:
    """The joints by which a body and those above it hang."""
    way = []
    while body in up:
        body, edge = up[body]
        way.append(edge)
    return way


def _collinear(state: MachineState, edge: _Edge, other: _Edge) -> bool:
    one, two = state.blocks[edge.second], state.blocks[other.second]
    if not (_joint_type(one) in _TURNING and _joint_type(two) in _TURNING):
        return False
    along = (_axis(two), subtract(_pivot(two), _pivot(one)))
    return all(math.hypot(*cross(_axis(one), line)) < _COLLINEAR for line in along)


def _held_teeth(
    label: Mapping[str, str], free: Sequence[_Edge], meshes: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """Cogs that mesh with one which is fast to what they are mounted on."""
    body = {edge.second: label[edge.first] for edge in free}  # that a cog turns on
    return {
        cog: (other,)
        for cog, other in meshes
        if cog in body and other not in body and body[cog] == label[other]
    }


def _driving(
    label: Mapping[str, str], free: Sequence[_Edge], meshes: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """The meshes of cogs that turn on one body."""
    body = {edge.second: label[edge.first] for edge in free}  # that a cog turns on
    driving: dict[str, tuple[str, ...]] = {}
    for cog, other in meshes:
        if cog in body and body[cog] == body.get(other):
            driving[cog] = (*driving.get(cog, ()), other)
    return driving
