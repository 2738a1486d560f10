"""Conversion of a machine of the geometry library to the simulation's arrays."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from buildarena_geometry.modules.joints import MOVING_JOINTS, UP, MovingJoint
from buildarena_geometry.modules.solids import Ball, Cylinder
from buildarena_simulation.constants import MAX_PARTS, JointKind
from buildarena_simulation.control import Bindings
from buildarena_simulation.errors import MachineNotSimulable
from buildarena_simulation.structure.build import Link, Rope, build_structure
from buildarena_simulation.structure.model import FloatArray, Part, Shape, ShapeKind, Structure

if TYPE_CHECKING:
    from buildarena_geometry import Block, Connector, Joint, Machine
    from buildarena_geometry.blocks import FaceRef
    from buildarena_geometry.modules.solids import Solid


def structure_of(machine: "Machine") -> Structure:
    """Return the structure of a machine.

    Joints whose two sides were moved too far apart to hold are left out, so their blocks fall off,
    and so are those of blocks that lie loose.

    Raises:
        MachineNotSimulable: It has no blocks, or more parts than are simulated.
    """
    if not machine.blocks:
        raise MachineNotSimulable("the machine has no blocks")
    if machine.part_count > MAX_PARTS:
        raise MachineNotSimulable(
            f"the machine has {machine.part_count} parts; more than {MAX_PARTS} are not simulated"
        )
    parts = [_part(block) for block in machine.blocks.values()]
    index = {part.id: i for i, part in enumerate(parts)}
    links, ropes = [], []
    for joint in machine.joints:
        module = parts[index[joint.part]].module
        if joint.holds and not module.is_loose:
            rope_mount = module.rope_mount
            if rope_mount is None:
                links.append(_link(joint, index, parts))
            else:
                ropes.append(_rope_mount(joint, index, rope_mount.length))
    connectors = list(machine.connectors.values())
    braces = [c for c in connectors if c.module.link == "rigid"]
    winches = [c for c in connectors if c.module.link == "rope"]
    springs = [c for c in connectors if c.module.link == "spring"]
    for connector, share in zip(braces, _shares(braces), strict=True):
        links.append(
            Link(
                **_span(connector, index),
                kind=JointKind.BRACE,
                mass=connector.mass,
                share=share,
                faces=(connector.start, connector.end),
                strut=connector.module.strut,
            )
        )
    between: dict[frozenset[FaceRef], list[Connector]] = {}
    for winch in winches:
        between.setdefault(frozenset((winch.start, winch.end)), []).append(winch)
    # Winches between the same two faces are one rope: doubling it does not make it stronger.
    single = [alike[0] for alike in between.values()]
    for connector, alike, share in zip(single, between.values(), _shares(single), strict=True):
        ropes.append(
            Rope(
                **_span(connector, index),
                mass=sum(winch.module.mass for winch in alike),
                share=share,
            )
        )
    for connector, share in zip(springs, _shares(springs), strict=True):
        ropes.append(
            Rope(
                **_span(connector, index),
                mass=connector.module.mass,
                share=share,
                spring=connector.module.spring,
            )
        )
    hoses = [
        Rope(**_span(connector, index), mass=connector.module.mass)
        for connector in connectors
        if connector.module.link == "hose"
    ]
    return build_structure(parts, links, ropes, hoses)


class _Span(TypedDict):
    """Common fields of a brace and a rope; see `Link`."""

    name: str
    first: int
    second: int
    start: FloatArray
    end: FloatArray


def _span(connector: "Connector", index: Mapping[str, int]) -> _Span:
    return {
        "name": f"{connector.module.name} {connector.id}",
        "first": index[connector.start[0]],
        "second": index[connector.end[0]],
        "start": np.array(connector.start_xyz),
        "end": np.array(connector.end_xyz),
    }


def _shares(connectors: "Sequence[Connector]") -> list[float]:
    """Return each connector's share of one's stiffness or strength, by the others on its faces.

    Connectors that leave a face in one direction are together worth one; those that leave it at
    right angles or in opposite directions do not help each other.
    """
    ways: dict[FaceRef, list[tuple[int, FloatArray]]] = {}
    for k, connector in enumerate(connectors):
        span = np.array(connector.end_xyz) - np.array(connector.start_xyz)
        way = span / max(float(np.linalg.norm(span)), 1e-9)
        ways.setdefault(connector.start, []).append((k, way))
        ways.setdefault(connector.end, []).append((k, -way))
    company = np.ones(len(connectors))
    for leaving in ways.values():
        directions = np.array([way for _, way in leaving])
        alike = np.maximum(directions @ directions.T, 0.0) ** 2
        np.fill_diagonal(alike, 1.0)
        for (k, _), total in zip(leaving, alike.sum(axis=1), strict=True):
            company[k] = max(company[k], total)
    return [float(share) for share in 1.0 / company]


def bindings_of(machine: "Machine") -> Bindings:
    """Return the keys of each part's actions: the machine's blocks in order, then its springs."""
    springs = [c for c in machine.connectors.values() if c.module.link == "spring"]
    return [*(block.bindings for block in machine.blocks.values()), *(s.bindings for s in springs)]


def part_ids(machine: "Machine") -> list[str]:
    """Return the ids of the parts of `bindings_of`, in the same order."""
    springs = [c.id for c in machine.connectors.values() if c.module.link == "spring"]
    return [*machine.blocks, *springs]


def _part(block: "Block") -> Part:
    pose, module = block.world_from_block, block.module
    rotation = np.array(pose.rotation)
    shapes = tuple(_shape(solid, np.array(pose.position), rotation) for solid in module.body)
    if not shapes:
        raise MachineNotSimulable(f"block {block.id}: the module {module.name} has no body")
    physics = module.physics
    if physics is None:
        raise MachineNotSimulable(f"block {block.id}: the module {module.name} has no physics")
    shown = np.array(block.center_xyz)
    center = shapes[0].center if physics.mass_at == "body" else shown
    axis, pivot = np.zeros(3), center
    if physics.joint_type in MOVING_JOINTS:
        joint = module.joint or MovingJoint()
        axis = rotation[:, 2] if joint.axis == UP else rotation @ np.array(joint.axis)
        if joint.point is not None:
            pivot = np.array(pose.position) + rotation @ np.array(joint.point)
        elif module.motor is None:
            pivot = shapes[0].center
    direction = None
    if physics.joint_type == "axle":
        direction = axis
    elif block.pointing_xyz is not None:
        direction = np.array(block.pointing_xyz)
    return Part(
        id=block.id,
        module=module,
        physics=physics,
        center=center,
        shown=shown,
        rotation=rotation,
        shapes=shapes,
        direction=direction,
        forward_is_clockwise=block.forward_is_clockwise,
        axis=axis,
        pivot=pivot,
    )


def _shape(solid: "Solid", position: FloatArray, rotation: FloatArray) -> Shape:
    if isinstance(solid, Cylinder):
        pose = solid.block_from_axis
        half = np.array([solid.radius, solid.radius, solid.length / 2])
        return Shape(
            kind=ShapeKind.CYLINDER,
            center=position + rotation @ np.array(pose.position),
            rotation=rotation @ np.array(pose.rotation),
            half_extents=half,
        )
    return Shape(
        kind=ShapeKind.SPHERE if isinstance(solid, Ball) else ShapeKind.BOX,
        center=position + rotation @ np.array(solid.center),
        rotation=rotation,
        half_extents=np.array(solid.size) / 2,
    )


def _link(joint: "Joint", index: dict[str, int], parts: list[Part]) -> Link:
    base, part = index[joint.base], index[joint.part]
    point = np.array(joint.part_xyz)
    return Link(
        name=f"{joint.base}-{joint.part}",
        first=base,
        second=part,
        kind=JointKind(parts[part].physics.joint_type),
        start=point,
        end=point,
    )


def _rope_mount(joint: "Joint", index: dict[str, int], length: float) -> Rope:
    point = np.array(joint.part_xyz)
    return Rope(
        name=f"{joint.base}-{joint.part}",
        first=index[joint.base],
        second=index[joint.part],
        start=point,
        end=point,
        mass=0.0,
        length=length,
    )
