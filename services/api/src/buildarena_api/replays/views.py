"""What a replay is answered with."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from buildarena_backend.replays.chapters import Chapter, Replay, ReplayStep
from buildarena_geometry import AttemptedBlock, Block, Connector

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class PlacedPart(BaseModel):
    """A block, and where it would have been."""

    id: str
    module: str = Field(examples=["Small Wooden Block"])
    position: Vector = Field(description="Of its root point, world frame, units")
    quaternion: Quaternion = Field(description="World from block, (w, x, y, z)")


class PartView(PlacedPart):
    """A part, and where it is after the step."""

    start: Vector | None = Field(description="Of a connector: where it begins, world frame, units")
    end: Vector | None = Field(description="Of a connector: where it ends")
    flipped: bool = Field(description="Whether a wheel's sense of rotation is reversed")
    bindings: dict[str, list[str]] = Field(description="Keys by action")


class KeyPress(BaseModel):
    """A key that is held for a while."""

    model_config = ConfigDict(from_attributes=True)

    time_s: float
    key: str
    hold_for_s: float


class StepView(BaseModel):
    """One action and what came of it."""

    turn: int | None = Field(
        description="Index of its turn in the transcript; null for what the session did by itself"
    )
    action: str = Field(examples=["attach_block_to"])
    arguments: Any
    accepted: bool
    reason: str | None = Field(description="Refusal class; null if it was accepted")
    text: str | None = Field(description="Why it was refused; null if it was accepted")
    added: list[PartView]
    moved: list[PartView] = Field(description="Parts in another place than before")
    removed: list[str] = Field(description="Ids of parts that are gone")
    rebound: list[PartView] = Field(description="Parts with other keys or sense of rotation")
    control_sequence: list[KeyPress] | None = Field(
        description="All key presses, if the action changed them"
    )
    attempted: list[PlacedPart] = Field(
        description="Blocks where a refused action would have put them, if that is known"
    )


class ChapterView(BaseModel):
    """How one machine came about."""

    name: str
    kind: Literal["machine", "sub_structure", "assembly"] = Field(
        description="An assembly is put together from copies of the sub-structures"
    )
    steps: list[StepView]


class ReplayView(BaseModel):
    """How a job's machine came about, as the geometry library builds it again."""

    chapters: list[ChapterView] = Field(
        description="Sub-structures, then their assembly; each begins with nothing"
    )
    complete: bool = Field(
        description="False where the steps are too many or too large: the last are left out"
    )
    exact: bool | None = Field(
        description="Whether it ends in exactly the kept machine; null while none is kept"
    )


def replay_view(replay: Replay, *, exact: bool | None) -> ReplayView:
    """A replay as it is answered."""
    return ReplayView(
        chapters=[_chapter(chapter) for chapter in replay.chapters],
        complete=replay.complete,
        exact=exact,
    )


def _chapter(chapter: Chapter) -> ChapterView:
    return ChapterView(
        name=chapter.name, kind=chapter.kind, steps=[_step(step) for step in chapter.steps]
    )


def _step(step: ReplayStep) -> StepView:
    changed = step.difference
    pressed = changed.control_sequence
    return StepView(
        turn=step.turn,
        action=step.action,
        arguments=step.arguments,
        accepted=step.accepted,
        reason=step.reason,
        text=step.text,
        added=_parts(changed.added),
        moved=_parts(changed.moved),
        removed=list(changed.removed),
        rebound=_parts(changed.rebound),
        control_sequence=None
        if pressed is None
        else [KeyPress.model_validate(one) for one in pressed],
        attempted=[_attempted(block) for block in step.attempted],
    )


def _parts(parts: Iterable[Block | Connector]) -> list[PartView]:
    return [block_view(part) if isinstance(part, Block) else connector_view(part) for part in parts]


def block_view(block: Block) -> PartView:
    """A block where it is."""
    pose = block.world_from_block
    return PartView(
        id=block.id,
        module=block.module.name,
        position=pose.xyz,
        quaternion=pose.wxyz,
        start=None,
        end=None,
        flipped=block.flipped,
        bindings={action: list(keys) for action, keys in block.bindings.items()},
    )


def connector_view(link: Connector) -> PartView:
    """A connector where it is."""
    pose = link.world_from_connector
    return PartView(
        id=link.id,
        module=link.module.name,
        position=pose.xyz,
        quaternion=pose.wxyz,
        start=link.start_xyz,
        end=link.end_xyz,
        flipped=False,
        bindings={},
    )


def _attempted(block: AttemptedBlock) -> PlacedPart:
    return PlacedPart(
        id=block.id, module=block.module, position=block.position, quaternion=block.quaternion
    )
