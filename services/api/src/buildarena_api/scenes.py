"""What a trial's scene is answered with: no page that draws it needs to know physics."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

from pydantic import BaseModel, Field

from buildarena_geometry import Block, Box, Connector, Cylinder, Machine, Module
from buildarena_simulation import Scenario

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class SolidView(BaseModel):
    """A solid of a module, in the block's frame, units."""

    shape: Literal["box", "cylinder", "sphere"]
    center: Vector
    quaternion: Quaternion = Field(
        description="Block from solid, (w, x, y, z); a cylinder's axis is its z"
    )
    size: Vector = Field(
        description="Full extents; of a cylinder its diameter twice, and its length"
    )


class FlameView(BaseModel):
    """A flame's ball, ahead of the block's shown centre in the way it points."""

    along: float = Field(description="Units from the centre")
    radius: float


class ModuleShape(BaseModel):
    """What blocks of a module look like."""

    kind: str = Field(examples=["wheel"])
    center: Vector = Field(
        description="Its shown centre in the block's frame: what trajectories give as its position"
    )
    pointing: Vector | None = Field(description="The way a cannon or torch points, block's frame")
    bodies: list[SolidView]
    flames: list[FlameView]


class BlockPlace(BaseModel):
    """A block of the machine as it was built."""

    id: str
    module: str
    position: Vector = Field(description="Of its root point, machine's frame, units")
    quaternion: Quaternion


class ConnectorEnd(BaseModel):
    """An end of a connector."""

    block: str
    point: Vector = Field(description="In that block's frame, units")


class ConnectorPlace(BaseModel):
    """A connector of the machine."""

    id: str
    module: str
    joint: str = Field(
        description="What trajectories call it where it breaks", examples=["Brace 7"]
    )
    rope: bool = Field(description="Whether it pulls and never pushes")
    start: ConnectorEnd
    end: ConnectorEnd


class MachineScene(BaseModel):
    """The machine's parts, and the modules that they are of."""

    modules: dict[str, ModuleShape]
    blocks: list[BlockPlace]
    connectors: list[ConnectorPlace]
    controller: str = Field(description="The program that acts; empty where keys are pressed")


class SceneView(BaseModel):
    """All that a trial looks like but for how it goes."""

    scenario: dict[str, Any] = Field(
        description="As tasks have it: duration_s, terrain, cargo, placement, control. Terrain is "
        "tilted by slope_deg about the east-west axis through its centre, and then turned by "
        "heading_deg about the vertical"
    )
    machine: MachineScene | None = Field(description="null while nothing was built")


def scene_view(scenario: Scenario, machine: Machine | None) -> SceneView:
    """The scene of a trial.

    Args:
        scenario: What the machine is put through.
        machine: The machine, if there is one.
    """
    return SceneView(
        scenario=scenario.model_dump(mode="json"),
        machine=None if machine is None else machine_scene(machine),
    )


def machine_scene(machine: Machine) -> MachineScene:
    """A machine's parts as it was built."""
    used = {block.module.name: block.module for block in machine.blocks.values()}
    return MachineScene(
        modules={name: _module(module) for name, module in used.items()},
        blocks=[_block(block) for block in machine.blocks.values()],
        connectors=[_connector(link, machine) for link in machine.connectors.values()],
        controller=machine.controller,
    )


def _module(module: Module) -> ModuleShape:
    return ModuleShape(
        kind=module.kind,
        center=module.center,
        pointing=module.pointing,
        bodies=list(_bodies(module)),
        flames=[FlameView(along=flame.along, radius=flame.radius) for flame in module.flames],
    )


def _bodies(module: Module) -> Iterable[SolidView]:
    for solid in module.body:
        if isinstance(solid, Cylinder):
            yield _cylinder(solid)
            continue
        shape: Literal["box", "sphere"] = "box" if isinstance(solid, Box) else "sphere"
        unturned = (1.0, 0.0, 0.0, 0.0)
        yield SolidView(shape=shape, center=solid.center, quaternion=unturned, size=solid.size)


def _cylinder(solid: Cylinder) -> SolidView:
    pose = solid.block_from_axis
    across = 2 * solid.radius
    return SolidView(
        shape="cylinder",
        center=pose.xyz,
        quaternion=pose.wxyz,
        size=(across, across, solid.length),
    )


def _block(block: Block) -> BlockPlace:
    pose = block.world_from_block
    return BlockPlace(
        id=block.id, module=block.module.name, position=pose.xyz, quaternion=pose.wxyz
    )


def _connector(link: Connector, machine: Machine) -> ConnectorPlace:
    return ConnectorPlace(
        id=link.id,
        module=link.module.name,
        joint=f"{link.module.name} {link.id}",
        rope=link.module.link != "rigid",
        start=_end(machine.blocks[link.start[0]], link.start[1]),
        end=_end(machine.blocks[link.end[0]], link.end[1]),
    )


def _end(block: Block, face: str) -> ConnectorEnd:
    return ConnectorEnd(block=block.id, point=block.module.face_of_label[face].center)
