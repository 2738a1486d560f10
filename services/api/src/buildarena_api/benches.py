"""What stands on a session's workbench, as the API answers it: enough to build on by hand."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.replays.views import (
    KeyPress,
    PartView,
    Vector,
    block_view,
    connector_view,
)
from buildarena_geometry import Block, Connector, Machine
from buildarena_geometry.feedback.words import caption


class FaceView(BaseModel):
    """A face of a block under construction."""

    label: str = Field(examples=["A"])
    side: str = Field(description="Where it looks, as feedback says it", examples=["East"])
    center: Vector = Field(description="World frame, units")
    normal: Vector = Field(description="Outwards, world frame, unit length")
    taken_by: str | None = Field(
        description="The block that it touches by an attachment; null if it takes a block"
    )


class WorkbenchPart(PartView):
    """A part of a machine under construction."""

    sits_on: tuple[str, str] | None = Field(
        description="Block and face that it is attached to; null for starting blocks, connectors "
        "and blocks whose base was removed"
    )
    ends: list[tuple[str, str]] = Field(description="Block and face of a connector's two ends")
    faces: list[FaceView] = Field(description="Of a block: what can be built on")
    actions: list[str] = Field(description="What keys can be bound to")
    spins: bool = Field(description="Whether its spin can be flipped")


class SubStructureView(BaseModel):
    """A copy of a machine in an assembly."""

    model_config = ConfigDict(from_attributes=True)

    letter: str
    source: str = Field(description="The machine that it is a copy of")


class WorkbenchMachine(BaseModel):
    """A machine under construction."""

    name: str
    parts: list[WorkbenchPart]
    control_sequence: list[KeyPress]
    controller: str = Field(description="The program that acts in place of it, Lua; empty for none")
    sub_structures: list[SubStructureView] = Field(description="Of an assembly")
    available: list[str] = Field(description="Machines that an assembly can be put together from")
    mass: float = Field(description="Mass units")
    detached: list[str] = Field(description="Blocks without a path to the starting block")


def machine_view(name: str, machine: Machine) -> WorkbenchMachine:
    """A machine under construction.

    Args:
        name: Its name on the workbench.
        machine: The machine.
    """
    return WorkbenchMachine(
        name=name,
        parts=[
            *(_block(block, machine) for block in machine.blocks.values()),
            *(_connector(link) for link in machine.connectors.values()),
        ],
        control_sequence=[KeyPress.model_validate(one) for one in machine.control_sequence],
        controller=machine.controller,
        sub_structures=[
            SubStructureView.model_validate(one) for one in machine.sub_structures.values()
        ],
        available=list(machine.available),
        mass=machine.mass,
        detached=list(machine.detached),
    )


def _block(block: Block, machine: Machine) -> WorkbenchPart:
    return WorkbenchPart(
        **block_view(block).model_dump(),
        sits_on=block.mount,
        ends=[],
        faces=[_face(block, face.label, machine) for face in block.module.faces],
        actions=list(block.module.actions),
        spins=block.module.spins,
    )


def _connector(link: Connector) -> WorkbenchPart:
    return WorkbenchPart(
        **connector_view(link).model_dump(),
        sits_on=None,
        ends=[link.start, link.end],
        faces=[],
        actions=list(link.module.actions),
        spins=False,
    )


def _face(block: Block, label: str, machine: Machine) -> FaceView:
    state = machine.state
    normal = block.face_normal(label)
    taken_by = state.occupants.get((block.id, label))
    if taken_by is None and state.is_occupied(block, label):
        taken_by = None if block.mount is None else block.mount[0]
    return FaceView(
        label=label,
        side=caption(normal).strip("<>"),
        center=block.face_center(label),
        normal=normal,
        taken_by=taken_by,
    )
