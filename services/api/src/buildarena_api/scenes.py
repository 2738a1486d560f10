"""Scenes of trials, with everything that a page needs to draw them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from buildarena_api.replays import PlacedPart, Quaternion, Vector
from buildarena_api.schemas import View
from buildarena_geometry import Block, Box, Connector, Cylinder, Machine
from buildarena_geometry.modules.solids import Solid


class SolidView(View):
    """A solid of a module, in the block's frame, units."""

    shape: Literal["box", "cylinder", "sphere"]
    center: Vector
    quaternion: Quaternion
    """Block from solid, (w, x, y, z); a cylinder's axis is its z."""
    size: Vector
    """Full extents; of a cylinder its diameter twice, and its length."""


def _solid(solid: Solid) -> SolidView:
    if isinstance(solid, Cylinder):
        pose, across = solid.block_from_axis, 2 * solid.radius
        size = (across, across, solid.length)
        return SolidView(shape="cylinder", center=pose.xyz, quaternion=pose.wxyz, size=size)
    shape: Literal["box", "sphere"] = "box" if isinstance(solid, Box) else "sphere"
    unturned = (1.0, 0.0, 0.0, 0.0)
    return SolidView(shape=shape, center=solid.center, quaternion=unturned, size=solid.size)


class FlameView(View):
    """A flame's ball, ahead of the block's shown centre in the way it points."""

    along: float
    """Units from the centre."""
    radius: float


class ModuleShape(View):
    """Appearance of a module's blocks."""

    kind: str = Field(examples=["wheel"])
    center: Vector
    """Its shown centre in the block's frame: its position in trajectories."""
    pointing: Vector | None
    """The way a cannon or torch points, block's frame."""
    bodies: list[Annotated[SolidView, BeforeValidator(_solid)]] = Field(validation_alias="body")
    flames: list[FlameView]


class BlockPlace(PlacedPart):
    """A block of the machine as it was built, in the machine's frame."""


class ConnectorEnd(View):
    """An end of a connector."""

    block: str
    point: Vector
    """In that block's frame, units."""


class ConnectorPlace(View):
    """A connector of the machine."""

    id: str
    module: str
    joint: str = Field(examples=["Brace 7"])
    """Its name in trajectories, where it breaks."""
    rope: bool
    """Whether it pulls and never pushes."""
    start: ConnectorEnd
    end: ConnectorEnd


class MachineScene(View):
    """The machine's parts, and the modules that they are of."""

    modules: dict[str, ModuleShape]
    blocks: list[BlockPlace]
    connectors: list[ConnectorPlace]
    controller: str
    """The program that acts; empty where keys are pressed."""


class SceneView(View):
    """Everything in the scene of a trial except its course."""

    scenario: dict[str, Any]
    """As tasks have it: duration_s, terrain, cargo, placement, control. Terrain is tilted by
    slope_deg about the east-west axis through its centre, and then turned by heading_deg about the
    vertical."""
    machine: MachineScene | None
    """null while nothing was built."""


def machine_scene(machine: Machine) -> MachineScene:
    """Return a machine's parts as it was built."""
    used = {block.module.name: block.module for block in machine.blocks.values()}
    return MachineScene(
        modules={name: ModuleShape.model_validate(module) for name, module in used.items()},
        blocks=[BlockPlace.model_validate(block) for block in machine.blocks.values()],
        connectors=[_connector(link, machine) for link in machine.connectors.values()],
        controller=machine.controller,
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
