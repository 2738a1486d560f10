"""Actions that adjust blocks that are already in place."""

from dataclasses import replace

from buildarena_geometry.actions.lookups import part
from buildarena_geometry.actions.parameters import BlockId, Number, RefusalError, Triple
from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.feedback import state as words
from buildarena_geometry.feedback.words import listing, plain, point
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Vector, about_axis
from buildarena_geometry.state import Change, MachineState

LARGEST_SHIFT = 0.5  # units a call in each direction


def twist_block(state: MachineState, block_id: BlockId, angle: Number) -> Change:
    """Turn a block on its face by degrees, clockwise seen from outside; blocks on it stay.

    Args:
        block_id: Id of the block.
        angle: Degrees, clockwise seen from outside that face.
    """
    target = part(state, block_id)
    if target.module.kind == "start":
        text = f"{words.heading(target)} sits on no face and can't be twisted."
        raise RefusalError(Cause.START_BLOCK, text)
    turn = about_axis(_seat_normal(state, target), -angle)
    by = f"by {plain(angle)}°"
    if isinstance(target, Connector):
        pose = target.world_from_connector.turned(turn)
        return _move_connector(state, target, pose, f"Twisted {by}")
    return _move(state, target, target.world_from_block.turned(turn), f"twisted {by}", turned=True)


def shift_block(state: MachineState, block_id: BlockId, shift_real: Triple) -> Change:
    """Move a block by [east, north, up], each at most 0.5; blocks on it stay.

    Args:
        block_id: Id of the block.
        shift_real: [east, north, up], each between -0.5 and 0.5.
    """
    target = part(state, block_id)
    if max(map(abs, shift_real)) > LARGEST_SHIFT:
        limit = f"at most {LARGEST_SHIFT} in each direction"
        text = f"One call shifts by {limit}, not {point(shift_real)}."
        raise RefusalError(Cause.OUT_OF_RANGE, text)
    moved = f"by {point(shift_real)}"
    if isinstance(target, Connector):
        pose = target.world_from_connector.shifted(shift_real)
        return _move_connector(state, target, pose, f"Shifted {moved}")
    pose = target.world_from_block.shifted(shift_real)
    return _move(state, target, pose, f"shifted {moved}", turned=False)


def flip_spin(state: MachineState, block_id: BlockId) -> Change:
    """Reverse the direction in which a wheel or driven hinge turns.

    Args:
        block_id: Id of the wheel.
    """
    target = part(state, block_id)
    if isinstance(target, Connector) or not target.module.spins:
        wheels = listing(block.id for block in state.blocks.values() if block.module.spins)
        text = f"{words.heading(target)} does not spin. Blocks that do: {wheels}."
        raise RefusalError(Cause.NOT_SPINNING, text)
    block = replace(target, flipped=not target.flipped)
    after = state.with_blocks(block)
    return Change(
        after=after,
        touched=(block.id,),
        render=lambda: f"Flipped. {words.place_line(after, block)}.",
    )


def _seat_normal(state: MachineState, target: Block | Connector) -> Vector:
    """Return the present normal of the face a part sits on; its own axis if it sits on none."""
    seat = target.start if isinstance(target, Connector) else target.mount
    if seat is None:
        assert isinstance(target, Block)  # noqa: S101  only blocks can lose their seat
        return target.axis_xyz
    return state.blocks[seat[0]].face_normal(seat[1])


def _move(state: MachineState, block: Block, pose: Pose, change: str, *, turned: bool) -> Change:
    moved = replace(block, world_from_block=pose)
    after = state.with_blocks(moved)

    def render() -> str:
        sentences = [f"Moved. {words.place_line(after, moved)}."]
        if turned and moved.module.faces:
            sentences.append(f"Free faces: {words.free_faces(after, moved)}.")
        sentences += words.seats(state, after, moved.id)
        return " ".join([*sentences, *words.losses(state, after)])

    return Change(
        after=after, placed=(block.id,), attempt=f"{words.heading(block)} {change}", render=render
    )


def _move_connector(state: MachineState, link: Connector, pose: Pose, change: str) -> Change:
    moved = replace(link, world_from_connector=pose)
    after = state.with_connector(moved)
    return Change(
        after=after,
        touched=(link.id,),
        render=lambda: f"{change}; its ends stay on their faces. {words.connector_line(moved)}.",
    )
