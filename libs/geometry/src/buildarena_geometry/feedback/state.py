"""Blocks, connectors, joints and whole machines in words, made from the state alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from buildarena_geometry.feedback.words import (
    caption,
    counted,
    listing,
    number,
    plain,
    point,
    rolling,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from buildarena_geometry.blocks import Block, Connector, Joint
    from buildarena_geometry.rotations import Vector
    from buildarena_geometry.state import MachineState

LONGEST_NOTE = 80  # characters of a note that are shown
FLUSH_OFFSET = 1e-6  # units; a joint whose sides are nearer sits flush


def title(part: Block | Connector) -> str:
    """What a part is called: "block 3 (Torch)"."""
    return f"block {part.id} ({part.module.name})"


def heading(part: Block | Connector) -> str:
    """The same at the start of a sentence."""
    return f"B{title(part)[1:]}"


def block_line(block: Block, joint: Joint | None) -> str:
    """A block in one line, without its faces.

    Args:
        block: the block.
        joint: what holds it to the face it sits on.
    """
    broken = ""
    if joint is not None and not joint.holds:
        broken = f", joint broken ({number(joint.offset)} apart)"
    return f"{place_line(block)}{broken}{_note(block.note)}"


def block_lines(state: MachineState, blocks: Iterable[Block]) -> list[str]:
    """Blocks of the state, a line each."""
    return [block_line(block, state.joint(block)) for block in blocks]


def place_line(block: Block) -> str:
    """A block in one line: what it sits on, where it is and what it does there."""
    facts = [f"{block.id} {block.module.name}"]
    if block.mount is not None:
        facts.append(f"on {block.mount[0]}/{block.mount[1]}")
    elif block.lost_mount is not None:
        facts.append("on nothing")
    facts.append(f"at {point(block.center_xyz)}")
    facts.extend(_use(block))
    return ", ".join(facts)


def connector_line(link: Connector) -> str:
    """A connector in one line."""
    (start, start_face), (end, end_face) = link.start, link.end
    return (
        f"{link.id} {link.module.name}, {start}/{start_face} {point(link.start_xyz)} to "
        f"{end}/{end_face} {point(link.end_xyz)}{_note(link.note)}"
    )


def idle(link: Connector) -> str:
    """A further sentence on a connector that begins and ends on one block; "" for others."""
    if link.start[0] != link.end[0]:
        return ""
    return f" Both faces are block {link.start[0]}'s, so it joins and strengthens nothing."


def faces(state: MachineState, block: Block) -> str:
    """The faces of a block: where they are, which way they look, what sits on them."""
    if not block.module.faces:
        return "No faces."
    rendered = []
    for face in block.module.faces:
        place = f"{face.label} {caption(block.face_normal(face.label))}"
        place += f" {point(block.face_center(face.label), 3)}"
        rendered.append(place + _use_of_face(state, block, face.label))
    return f"Faces: {'; '.join(rendered)}."


def placement(state: MachineState, block: Block) -> str:
    """A block with its faces: what a model has to know to build on."""
    return f"{block_line(block, state.joint(block))}.\n{faces(state, block)}"


def block_details(state: MachineState, block: Block) -> str:
    """Everything a model can ask about one block."""
    lines = [placement(state, block)]
    bound = [f"{action} {listing(keys)}" for action, keys in block.bindings.items()]
    if bound:
        lines.append(f"Keys: {'; '.join(bound)}.")
    links = [link.id for link in state.connectors.values() if block.id in _ends(link)]
    if links:
        lines.append(f"Connectors: {listing(links)}.")
    return "\n".join(lines)


def summary(state: MachineState) -> str:
    """The whole machine, one line a part, without faces."""
    if not state.started:
        return "Nothing is built yet."
    parts = counted(len(state.blocks) + len(state.connectors), "part")
    lines = [f"{parts}, mass {plain(state.mass)}, cost {state.cost}."]
    lines.extend(
        f"Sub-structure {structure.letter}: {structure.source}."
        for structure in state.structures.values()
    )
    joints = {joint.part: joint for joint in state.joints()}
    lines.extend(block_line(block, joints.get(block.id)) for block in state.blocks.values())
    lines.extend(connector_line(link) for link in state.connectors.values())
    lines.extend(detached(state, joints.values()))
    return "\n".join(lines)


def detached(state: MachineState, joints: Iterable[Joint]) -> list[str]:
    """A sentence about the blocks without a path to the first one, if there are any."""
    loose = state.detached(joints)
    if not loose:
        return []
    return [f"Not connected to block {next(iter(state.blocks))}: {listing(loose)}."]


def control_sequence(state: MachineState) -> str:
    """The control sequence, one entry a line, with the numbers `remove_control_sequence` takes."""
    if not state.control_sequence:
        return "The control sequence is empty."
    return "\n".join(
        f"{index}: at {plain(press.time_s)} s hold {press.key} for {plain(press.hold_for_s)} s"
        for index, press in enumerate(state.control_sequence)
    )


def control_config(state: MachineState) -> str:
    """Which key does what, block by block."""
    lines = [
        f"{block.id} {block.module.name}: "
        + "; ".join(f"{action} {listing(keys)}" for action, keys in block.bindings.items())
        for block in state.blocks.values()
        if block.bindings
    ]
    return "\n".join(lines) or "No block takes a key."


def powered_blocks(state: MachineState) -> str:
    """The blocks that take keys, where they are and what they do."""
    lines = block_lines(state, (block for block in state.blocks.values() if block.bindings))
    return "\n".join(lines) or "No block is powered."


def loosened(state: MachineState, moved: Iterable[str]) -> list[str]:
    """Sentences about joints at the moved blocks whose two sides no longer meet."""
    rendered = []
    for block in (state.blocks[moved_id] for moved_id in moved):
        joints = [state.joint(block), *(state.joint(child) for child in state.children(block))]
        for joint in joints:
            if joint is None or joint.offset <= FLUSH_OFFSET:
                continue
            verdict = "" if joint.holds else " and no longer holds"
            rendered.append(
                f"Block {joint.part} no longer sits flush on {joint.base}/{joint.face} "
                f"({number(joint.offset)} apart){verdict}."
            )
    return rendered


def _use(block: Block) -> list[str]:
    if block.module.spins:
        forward = rolling(block.axis_xyz, clockwise=block.forward_is_clockwise)
        return [forward + _flipped(block)]
    towards = block.pointing_xyz
    if towards is None:
        return []
    marks = [
        _landmark(mark.name, block.landmark(mark.along), mark.radius)
        for mark in block.module.landmarks
    ]
    return [f"points {caption(towards)}", *marks]


def _flipped(block: Block) -> str:
    return " (flipped)" if block.flipped else ""


def _landmark(name: str, place: Vector, radius: float | None) -> str:
    return f"{name} {point(place)}" + ("" if radius is None else f" radius {plain(radius)}")


def _use_of_face(state: MachineState, block: Block, label: str) -> str:
    child = state.occupants.get((block.id, label))
    if child is not None:
        return f" holds {child}"
    if block.mount is not None and label == block.module.root_face:
        return f" sits on {block.mount[0]}/{block.mount[1]}"
    return ""


def _ends(link: Connector) -> tuple[str, str]:
    return (link.start[0], link.end[0])


def _note(note: str) -> str:
    """A note on one line, cut short: it comes back in every summary."""
    words = " ".join(note.split())
    if len(words) > LONGEST_NOTE:
        words = f"{words[: LONGEST_NOTE - 1]}…"
    return f" — {words}" if words else ""
