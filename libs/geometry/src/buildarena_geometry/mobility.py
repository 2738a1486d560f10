"""Mobile joints of a machine as built, meshing cogs, and the parts that lock other joints.

Simulators find the same: blocks held together rigidly are one body; a joint between two sides of
one body does not move; joints that close a loop of bodies lock it, unless they turn about one line.
"""

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
from buildarena_geometry.state import MachineState, joined

FLUSH_TOLERANCE = 0.05
"""A far end that comes so near another block's face is joined to it, units."""
_OPPOSITE = 1.0 - 1e-3  # cosine; faces that look at each other
_COLLINEAR = 1e-3
_TURNING = ("axle", "hinge")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mobility:
    """Mobility of a machine's joints as it is built.

    Attributes:
        meshes: by cog, the cogs that it drives or that drive it.
        locks: by block whose joint cannot move, the parts that lock it: connectors, far ends, cogs,
            or the joints of the loop that it is in.
    """

    meshes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    locks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class _Edge(NamedTuple):
    """Rigid or moving connection of two blocks."""

    first: str  # id of the base
    second: str  # id of the block that sits on it, or of a connector's other end
    by: str = ""  # the part reported as holding them; "" for an ordinary attachment


def mobility(state: MachineState) -> Mobility:
    """Find the joints of a machine that can move, and the cogs that mesh."""
    if not any(_moves(block) for block in state.blocks.values()):
        return Mobility()
    rigid, joints = _edges(state)
    meshes = [way for pair in _touching_cogs(state) for way in (pair, pair[::-1])]
    locks: dict[str, tuple[str, ...]] = {}
    while True:
        label = joined(state.blocks, (edge[:2] for edge in rigid))
        free = [edge for edge in joints if label[edge.first] != label[edge.second]]
        for edge in joints:
            if edge.second not in locks and label[edge.first] == label[edge.second]:
                locks[edge.second] = _holding(rigid, edge)
        base = {edge.second: label[edge.first] for edge in free}  # the body that a cog turns on
        newly_locked = {**_closed_loops(state, label, free), **_held_teeth(label, base, meshes)}
        if not newly_locked:
            return Mobility(meshes=_driving(base, meshes), locks=locks)
        locks.update(newly_locked)
        rigid += [_Edge(e.first, e.second, e.second) for e in free if e.second in newly_locked]


def _joint_type(block: Block) -> str | None:
    return None if block.module.physics is None else block.module.physics.joint_type


def _moves(block: Block) -> bool:
    return _joint_type(block) in MOVING_JOINTS


def _edges(state: MachineState) -> tuple[list[_Edge], list[_Edge]]:
    """Return the rigid connections, and the joints that may move."""
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
    """Yield the joints of far ends that lie flush on a block of the frame."""
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
            offset = subtract(tip, center)
            if dot(offset, offset) > reach * reach or holder is block:
                continue
            pair = frozenset((block.id, holder.id))
            if pair not in joined and _is_flush(offset, outward, axes, _half(holder)):
                joined.add(pair)
                yield _Edge(block.id, holder.id, block.id)


def _is_flush(offset: Vector, outward: Vector, axes: Sequence[Vector], half: Vector) -> bool:
    local = [dot(offset, axis) for axis in axes]
    facing = [dot(outward, axis) for axis in axes]
    if any(abs(x) > h + FLUSH_TOLERANCE for x, h in zip(local, half, strict=True)):
        return False
    return any(
        abs(f) > _OPPOSITE and abs(x + math.copysign(h, f)) <= FLUSH_TOLERANCE
        for x, f, h in zip(local, facing, half, strict=True)
    )


def _shape(block: Block) -> tuple[Vector, tuple[Vector, Vector, Vector]]:
    """Return the middle of a block's first solid and that solid's axes, world frame."""
    solid, pose = block.module.body[0], block.world_from_block
    turned = pose @ solid.block_from_axis if isinstance(solid, Cylinder) else pose
    x, y, z = map(turned.direction, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    return pose.point(solid.center), (x, y, z)


def _half(block: Block) -> Vector:
    """Return half the extents of a block's first solid along its axes, units."""
    solid = block.module.body[0]
    if isinstance(solid, Cylinder):
        return (solid.radius, solid.radius, solid.length / 2)
    x, y, z = solid.size
    return (x / 2, y / 2, z / 2)


def _touching_cogs(state: MachineState) -> Iterator[tuple[str, str]]:
    """Yield the pairs of adjacent cogs with parallel axes whose pitch circles touch."""
    cogs = [
        (block, block.module.gear.pitch_radius, *_shape(block))
        for block in state.blocks.values()
        if block.module.gear is not None
    ]
    for (a, radius_a, center_a, _), (b, radius_b, center_b, _) in combinations(cogs, 2):
        axis = _axis(a)
        offset = subtract(center_b, center_a)
        along = dot(offset, axis)
        across = math.hypot(*subtract(offset, scaled(axis, along)))
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


def _holding(rigid: Sequence[_Edge], joint: _Edge) -> tuple[str, ...]:
    """Return the names on the shortest rigid path from one side of a joint to the other."""
    neighbours = defaultdict[str, list[tuple[str, str]]](list)
    for first, second, by in rigid:
        neighbours[first].append((second, by))
        neighbours[second].append((first, by))
    previous: dict[str, tuple[str, str]] = {joint.first: ("", "")}
    waiting = [joint.first]
    for current in waiting:
        for other, by in neighbours[current]:
            if other not in previous:
                previous[other] = (current, by)
                waiting.append(other)
    named, block = [], joint.second
    while block != joint.first:
        block, by = previous[block]
        named.append(by)
    return tuple(dict.fromkeys(by for by in reversed(named) if by and by != joint.second))


def _closed_loops(
    state: MachineState, label: Mapping[str, str], free: Sequence[_Edge]
) -> dict[str, tuple[str, ...]]:
    """Return the joints of loops that cannot move, with the others of their loop."""
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
    """Return trees of bodies along joints, from the heaviest out: each body's parent and joint."""
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
    """Return the joints of the tree between two bodies."""
    ways = [_upwards(up, body) for body in (a, b)]
    # The two paths share their beginning, from the root.
    while ways[0] and ways[1] and ways[0][-1] is ways[1][-1]:
        del ways[0][-1], ways[1][-1]
    return [*ways[0], *ways[1]]


def _upwards(up: Mapping[str, tuple[str, _Edge]], body: str) -> list[_Edge]:
    """Return the joints between a body and the root of its tree."""
    way = []
    while body in up:
        body, edge = up[body]
        way.append(edge)
    return way


def _collinear(state: MachineState, edge: _Edge, other: _Edge) -> bool:
    first, second = state.blocks[edge.second], state.blocks[other.second]
    if not (_joint_type(first) in _TURNING and _joint_type(second) in _TURNING):
        return False
    along = (_axis(second), subtract(_pivot(second), _pivot(first)))
    return all(math.hypot(*cross(_axis(first), line)) < _COLLINEAR for line in along)


def _held_teeth(
    label: Mapping[str, str], base: Mapping[str, str], meshes: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """Return the cogs that mesh with one which is fixed to their own base."""
    return {
        cog: (other,)
        for cog, other in meshes
        if cog in base and other not in base and base[cog] == label[other]
    }


def _driving(
    base: Mapping[str, str], meshes: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """Return the cogs that mesh although they turn on one body."""
    driving: dict[str, tuple[str, ...]] = {}
    for cog, other in meshes:
        if cog in base and base[cog] == base.get(other):
            driving[cog] = (*driving.get(cog, ()), other)
    return driving
