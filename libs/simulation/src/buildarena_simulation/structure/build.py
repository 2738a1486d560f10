"""Conversion of parts and joints to the arrays of a `Structure`: masses, members, far joints."""

import math
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np

from buildarena_geometry.modules.forces import Spring, Strut
from buildarena_geometry.modules.joints import MESH_COSINE, MESH_SLACK
from buildarena_geometry.modules.module import Sphere
from buildarena_simulation.constants import (
    BRACE_STIFFNESS,
    GRAVITY,
    JOINT_STIFFNESS,
    JOINT_STRENGTH,
    ROPE_STRENGTH,
    JointKind,
)
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    FloatArray,
    IntArray,
    Joints,
    Members,
    Mesh,
    Part,
    Ropes,
    ShapeKind,
    Spheres,
    Structure,
)
from buildarena_simulation.structure.vectors import axis_frame

_UNIT_STIFFNESS: Final = 1e4
"""Stiffness that keeps the matrix well scaled; only ratios affect the loads."""

_JOINT_SPRINGS: Final = _UNIT_STIFFNESS * np.array(JOINT_STIFFNESS)
_BRACE_AXIAL: Final = BRACE_STIFFNESS * _UNIT_STIFFNESS
_BRACE_THICKNESS: Final = 0.4
_FLUSH_TOLERANCE: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """A joint between two blocks of one machine.

    Attributes:
        name: Name for messages.
        first: Index of one block.
        second: Index of the other block.
        start: (3,) its point on the first block, machine frame, units.
        end: (3,) its point on the second block; equals `start` unless it is a brace.
        mass: Own mass, half of which each end's block carries, mass units.
        share: Share of one connector's stiffness: connectors that leave a face in the same
            direction are together no stiffer than one.
        faces: Identifiers of the faces at its start and end; None for joints of attachments.
        strut: Its buckling data; None if it does not buckle.
    """

    name: str
    first: int
    second: int
    kind: JointKind
    start: FloatArray
    end: FloatArray
    mass: float = 0.0
    share: float = 1.0
    faces: tuple[Hashable, Hashable] | None = None
    strut: Strut | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Rope:
    """A winch, rope mount or spring between two blocks; fields as in `Link`.

    Attributes:
        share: Its share of a rope's strength, or of a spring's strength, stiffness and damping.
        length: Length of a rope mount, units; None for its built length.
        spring: Its properties as a spring; None for a rope.
    """

    name: str
    first: int
    second: int
    start: FloatArray
    end: FloatArray
    mass: float
    share: float = 1.0
    length: float | None = None
    spring: Spring | None = None


def build_structure(
    parts: Sequence[Part],
    links: Sequence[Link],
    ropes: Sequence[Rope],
    hoses: Sequence[Rope] = (),
) -> Structure:
    """Build the structure of a machine, and find its far joints.

    Args:
        parts: Blocks, in creation order.
        links: Attachments, axles and braces.
        ropes: Winches.
        hoses: Hoses, which only add mass.

    Returns:
        The structure, in the frame the parts are given in.
    """
    lumps: list[list[tuple[float, FloatArray]]] = [[] for _ in parts]
    for link in links:
        if link.kind is JointKind.BRACE:
            lumps[link.first].append((link.mass / 2, link.start))
            lumps[link.second].append((link.mass / 2, link.end))
    for rope in (*ropes, *hoses):
        lumps[rope.first].append((rope.mass / 2, rope.start))
        lumps[rope.second].append((rope.mass / 2, rope.end))
    lumped = [_lump(part, extra) for part, extra in zip(parts, lumps, strict=True)]
    directions = np.array(
        [np.zeros(3) if part.direction is None else part.direction for part in parts]
    )
    shown = np.array([part.shown for part in parts])
    motors = [part.module.motor for part in parts]
    thrusts = [(i, part.module.thrust) for i, part in enumerate(parts) if part.module.thrust]
    cannons = _indices(i for i, _ in thrusts)
    along = np.array([thrust.along for _, thrust in thrusts])
    return Structure(
        parts=tuple(parts),
        positions=np.array([part.center for part in parts]),
        shown=shown,
        rotations=np.array([part.rotation for part in parts]),
        masses=np.array([mass for mass, _, _ in lumped]),
        centers_of_mass=np.array([center for _, center, _ in lumped]),
        inertias=np.array([inertia for _, _, inertia in lumped]),
        members=_members(parts, [*links, *_far_joints(parts, links)]),
        joints=joints_of(parts),
        ropes=_ropes(ropes),
        wheels=_indices(i for i, part in enumerate(parts) if part.is_wheel),
        cannons=cannons,
        torches=_indices(i for i, part in enumerate(parts) if part.module.flames),
        directions=directions,
        torques=np.array([motor.torque if motor else 0.0 for motor in motors]),
        thrust_points=shown[cannons] + along[:, None] * directions[cannons],
        cold_thrusts=np.array([thrust.cold for _, thrust in thrusts]),
        heated_thrusts=np.array([thrust.heated for _, thrust in thrusts]),
        heat_bodies=_spheres((i, sphere) for i, thrust in thrusts for sphere in thrust.spheres),
        flames=_spheres((i, flame) for i, part in enumerate(parts) for flame in part.module.flames),
        linear_drag=np.array(
            [
                part.physics.linear_drag * (part.mass / mass)
                for part, (mass, _, _) in zip(parts, lumped, strict=True)
            ]
        ),
        angular_drag=np.array([part.physics.angular_drag for part in parts]),
        hoses=tuple((hose.first, hose.second) for hose in hoses),
    )


def _indices(blocks: Iterable[int]) -> IntArray:
    return np.array(list(blocks), dtype=np.int64)


def _spheres(of_blocks: Iterable[tuple[int, Sphere]]) -> Spheres:
    rows = list(of_blocks)
    return Spheres(
        block=_indices(block for block, _ in rows),
        along=np.array([sphere.along for _, sphere in rows]),
        radius=np.array([sphere.radius for _, sphere in rows]),
    )


def _lump(
    part: Part, extra: Sequence[tuple[float, FloatArray]]
) -> tuple[float, FloatArray, FloatArray]:
    mass = part.mass + sum(m for m, _ in extra)
    center = (part.mass * part.center + sum((m * p for m, p in extra), np.zeros(3))) / mass
    inertia = _own_inertia(part) + _point_inertia(part.mass, part.center - center)
    for m, point in extra:
        inertia += _point_inertia(m, point - center)
    return mass, center, inertia


def _own_inertia(part: Part) -> FloatArray:
    """Return a block's inertia about its own centre of mass, its mass even over its shapes."""
    volumes = np.array([shape.volume for shape in part.shapes])
    shares = volumes / volumes.sum()
    middle = sum(
        (s * shape.center for s, shape in zip(shares, part.shapes, strict=True)), np.zeros(3)
    )
    inertia = np.zeros((3, 3))
    for share, shape in zip(shares, part.shapes, strict=True):
        a, b, c = shape.half_extents
        if shape.kind is ShapeKind.CYLINDER:
            across = (3 * a**2 + (2 * c) ** 2) / 12
            principal = np.array([across, across, a**2 / 2])
        elif shape.kind is ShapeKind.SPHERE:
            principal = np.full(3, 2 * a**2 / 5)
        else:
            principal = np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2]) / 3
        inertia += share * part.mass * (shape.rotation * principal) @ shape.rotation.T
        inertia += _point_inertia(share * part.mass, shape.center - middle)
    return inertia


def _point_inertia(mass: float, r: FloatArray) -> FloatArray:
    return np.asarray(mass * (r @ r * np.eye(3) - np.outer(r, r)))


def _far_joints(parts: Sequence[Part], links: Sequence[Link]) -> list[Link]:
    """Return the joints where the far face of a block that grabs lies flush on another block.

    Source: public modding notes: small wooden blocks have a second joint at the far end that grabs
    what it touches.
    """
    joined = {
        frozenset((link.first, link.second)) for link in links if link.kind is not JointKind.BRACE
    }
    holders = [i for i, part in enumerate(parts) if part.physics.structural]
    if not holders:
        return []
    bodies = [parts[i].shapes[0] for i in holders]
    centers = np.array([body.center for body in bodies])
    rotations = np.array([body.rotation for body in bodies])
    halves = np.array([body.half_extents for body in bodies])
    joints = []
    for i, part in enumerate(parts):
        if not part.module.grabs:
            continue
        outward = part.rotation[:, 2]
        tip = part.shapes[0].center + part.shapes[0].half_extents[2] * outward
        local = np.einsum("nji,nj->ni", rotations, tip - centers)
        facing = np.einsum("nji,j->ni", rotations, outward)
        inside = (np.abs(local) <= halves + _FLUSH_TOLERANCE).all(axis=1)
        # Flush: the tip lies on a face of the other block, whose normal is opposite to ours.
        on_face = (np.abs(local + halves * np.sign(facing)) <= _FLUSH_TOLERANCE) & (
            np.abs(facing) > 1.0 - 1e-3
        )
        for k in np.flatnonzero(inside & on_face.any(axis=1)):
            j = holders[k]
            if j != i and frozenset((i, j)) not in joined:
                joined.add(frozenset((i, j)))
                name = f"{part.id}~{parts[j].id}"
                joints.append(
                    Link(name=name, first=i, second=j, kind=JointKind.FAR_JOINT, start=tip, end=tip)
                )
    return joints


def _members(parts: Sequence[Part], links: Sequence[Link]) -> Members:
    frames, stiffness = [], []
    for link in links:
        if link.kind is JointKind.BRACE:
            span = link.end - link.start
            length = float(np.linalg.norm(span))
            if length < _FLUSH_TOLERANCE:  # between faces that lie on each other
                span = parts[link.first].center - link.start
            frames.append(axis_frame(span))
            stiffness.append(link.share * _brace_springs(length))
        else:
            offset = parts[link.second].center - parts[link.first].center
            if np.linalg.norm(offset) < 1e-9:  # noqa: PLR2004 - centres coincide: any axis will do
                offset = parts[link.second].rotation[:, 2]
            frames.append(axis_frame(offset))
            stiffness.append(_JOINT_SPRINGS)
    strengths = [JOINT_STRENGTH[link.kind] for link in links]
    return Members(
        names=tuple(link.name for link in links),
        first=np.array([link.first for link in links], dtype=np.int64),
        second=np.array([link.second for link in links], dtype=np.int64),
        kind=np.array([JOINT_KINDS.index(link.kind) for link in links], dtype=np.int64),
        point=np.array([(link.start + link.end) / 2 for link in links]).reshape(-1, 3),
        frame=np.array(frames).reshape(-1, 3, 3),
        stiffness=np.array(stiffness).reshape(-1, 6),
        limits=np.array([(s.force, s.moment) for s in strengths]).reshape(-1, 2),
        buckling=np.array([_buckling(link) for link in links]),
        share=np.array([link.share for link in links]),
        ends=_shared_faces(links),
    )


def _buckling(link: Link) -> float:
    """Return the buckling force of a link, mass·g. Source: Euler's column, ends free to turn."""
    if link.strut is None:
        return math.inf
    length = max(float(np.linalg.norm(link.end - link.start)), _FLUSH_TOLERANCE)
    return link.share * math.pi**2 * link.strut.bending_stiffness / length**2


def _shared_faces(links: Sequence[Link]) -> IntArray:
    """Return ends of connectors at faces that several use, as in `Members.ends`."""
    ends = [
        (face, k, sign)
        for k, link in enumerate(links)
        if link.faces is not None
        for face, sign in zip(link.faces, (-1, 1), strict=True)
    ]
    used = Counter(face for face, _, _ in ends)
    place: dict[Hashable, int] = {}
    rows = [
        (k, sign, place.setdefault(face, len(place))) for face, k, sign in ends if used[face] > 1
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


def _brace_springs(length: float) -> FloatArray:
    """Return the springs of a brace: an Euler-Bernoulli beam of square section, at its midpoint."""
    bending = _BRACE_AXIAL * _BRACE_THICKNESS**2 / 12
    span = max(length, 0.5)
    return np.array(
        [
            _BRACE_AXIAL / span,
            12 * bending / span**3,
            12 * bending / span**3,
            0.8 * bending / span,
            bending / span,
            bending / span,
        ]
    )


def _of_springs(ropes: Sequence[Rope], figure: Literal["stiffness", "damping"]) -> FloatArray:
    """Return a figure of each rope's spring, times g; 0 for a rope."""
    return GRAVITY * np.array(
        [getattr(rope.spring, figure) * rope.share if rope.spring else 0.0 for rope in ropes]
    )


def _ropes(ropes: Sequence[Rope]) -> Ropes:
    first_point = np.array([rope.start for rope in ropes]).reshape(-1, 3)
    second_point = np.array([rope.end for rope in ropes]).reshape(-1, 3)
    return Ropes(
        names=tuple(rope.name for rope in ropes),
        first=np.array([rope.first for rope in ropes], dtype=np.int64),
        second=np.array([rope.second for rope in ropes], dtype=np.int64),
        first_point=first_point,
        second_point=second_point,
        length=np.array(
            [
                built if rope.length is None else rope.length
                for rope, built in zip(
                    ropes, np.linalg.norm(second_point - first_point, axis=1), strict=True
                )
            ]
        ),
        limit=np.array(
            [rope.share * (rope.spring.limit if rope.spring else ROPE_STRENGTH) for rope in ropes]
        ),
        stiffness=_of_springs(ropes, "stiffness"),
        damping=_of_springs(ropes, "damping"),
        spring_of=tuple(rope.spring for rope in ropes if rope.spring),
    )


def joints_of(parts: Sequence[Part]) -> Joints:
    """Return the joints between blocks and their bases."""
    wheels = [i for i, part in enumerate(parts) if part.is_wheel]
    movers = [i for i, part in enumerate(parts) if not part.is_wheel and _is_driven(part)]
    return Joints(
        axes=np.array([part.axis for part in parts]),
        points=np.array([part.pivot for part in parts]),
        simple=np.array([part.is_wheel and part.module.joint is None for part in parts]),
        driven=np.array([*wheels, *movers], dtype=np.int64),
        meshes=_meshes(parts),
    )


def _is_driven(part: Part) -> bool:
    return part.module.joint is not None and part.module.joint.drive is not None


def _meshes(parts: Sequence[Part]) -> tuple[Mesh, ...]:
    """Find the adjacent cogs with parallel axes whose pitch circles touch."""
    cogs = [(i, part, part.module.gear) for i, part in enumerate(parts)]
    meshes = []
    for (i, first, first_gear), (j, second, second_gear) in combinations(cogs, 2):
        if first_gear is None or second_gear is None:
            continue
        alike = float(first.axis @ second.axis)
        offset = second.shapes[0].center - first.shapes[0].center
        along = float(offset @ first.axis)
        distance = float(np.linalg.norm(offset - along * first.axis))
        thickness = first.shapes[0].half_extents[2] + second.shapes[0].half_extents[2]
        touch = abs(distance - first_gear.pitch_radius - second_gear.pitch_radius) <= MESH_SLACK
        if touch and abs(alike) >= MESH_COSINE and abs(along) < thickness - MESH_SLACK:
            # On parallel axes cogs turn against each other, on opposite ones the same way.
            ratio = -float(np.sign(alike)) * first_gear.pitch_radius / second_gear.pitch_radius
            meshes.append(Mesh(first=i, second=j, ratio=ratio))
    return tuple(meshes)
