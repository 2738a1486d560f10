"""Blocks, connectors, joints and whole machines in words, made from the state alone."""

from collections.abc import Iterable, Iterator, Mapping

from buildarena_geometry.blocks import JOINT_REACH, Block, Connector, Joint
from buildarena_geometry.feedback.joints import couplings, motions
from buildarena_geometry.feedback.words import (
    caption,
    counted,
    listing,
    number,
    plain,
    point,
    rolling,
)
from buildarena_geometry.flames import heating
from buildarena_geometry.mobility import Mobility, mobility
from buildarena_geometry.modules.module import Landmark
from buildarena_geometry.state import MachineState

LONGEST_NOTE = 80  # characters of a note that are shown
FLUSH_OFFSET = 1e-6  # units; a joint whose sides are nearer sits flush
NO_JOINT = f"More than {JOINT_REACH} off there is no joint: without connectors the two come apart."


def title(part: Block | Connector) -> str:
    """Return a part's name: "block 3 (Torch)"."""
    return f"block {part.id} ({part.module.name})"


def heading(part: Block | Connector) -> str:
    """Return a part's name for the start of a sentence: "Block 3 (Torch)"."""
    return f"B{title(part)[1:]}"


def block_line(state: MachineState, block: Block) -> str:
    """Describe a block in one line, without its faces."""
    return place_line(state, block) + _note(block.note)


def block_lines(
    state: MachineState, blocks: Iterable[Block], *, with_faces: bool = False
) -> list[str]:
    """Describe the blocks of the state, a line each.

    Args:
        with_faces: whether to add their faces' letters and sides.
    """
    heat, moving = heating(state), mobility(state)
    lines = ((block, _place_line(state, block, heat, moving)) for block in blocks)
    return [
        line + (_letters(state, block) if with_faces else "") + _note(block.note)
        for block, line in lines
    ]


def place_line(state: MachineState, block: Block) -> str:
    """Describe a block in one line: its base, position and purpose there."""
    return _place_line(state, block, heating(state), mobility(state))


def connector_line(link: Connector) -> str:
    """Describe a connector in one line."""
    start = f"{link.start[0]}/{link.start[1]} {point(link.start_xyz)}"
    end = f"{link.end[0]}/{link.end[1]} {point(link.end_xyz)}"
    return f"{link.id} {link.module.name}, {start} to {end}{_note(link.note)}"


def list_faces(block: Block, labels: Iterable[str]) -> str:
    """List faces of a block by letter and side: "A <East>, B <West>", or "none"."""
    return listing(face_name(block, label) for label in labels)


def face_name(block: Block, label: str) -> str:
    """Return the name of a block's face by letter and side: "B <West>"."""
    return f"{label} {caption(block.face_normal(label))}"


def free_faces(state: MachineState, block: Block) -> str:
    """List the faces of a block that take another one, by letter and side."""
    return list_faces(block, state.free_faces(block))


def idle(link: Connector) -> str:
    """Return a further sentence on a connector that begins and ends on one block; "" for others."""
    if len(set(link.ends)) > 1:
        return ""
    return f" Both faces are block {link.start[0]}'s, so it joins and strengthens nothing."


def faces(state: MachineState, block: Block) -> str:
    """Describe the faces of a block: positions, directions, and the blocks that sit on them."""
    if not block.module.faces:
        return "No faces."
    rendered = (
        f"{face_name(block, label)} {point(block.face_center(label), 3)}"
        f"{_use_of_face(state, block, label)}"
        for label in block.module.face_of_label
    )
    return f"Faces: {'; '.join(rendered)}."


def placement(state: MachineState, block: Block) -> str:
    """Describe a block with its free faces: all that a model needs to build on it."""
    if not block.module.faces:
        return f"{block_line(state, block)}. No faces."
    return f"{block_line(state, block)}. Free faces: {free_faces(state, block)}."


def block_details(state: MachineState, block: Block) -> str:
    """Describe a block completely, as `get_block_details` does."""
    lines = [f"{block_line(state, block)}.", faces(state, block)]
    if block.bindings:
        lines.append(f"Keys: {_bound(block)}.")
    links = [link.id for link in state.connectors.values() if block.id in link.ends]
    if links:
        lines.append(f"Connectors: {listing(links)}.")
    return "\n".join(lines)


def summary(state: MachineState) -> str:
    """Describe the whole machine, one line per part, without faces."""
    if not state.started:
        return "Nothing is built yet."
    parts = counted(len(state.blocks) + len(state.connectors), "part")
    lines = [
        f"{parts}, mass {plain(state.mass)}, cost {state.cost}.",
        _as_a_whole(state),
        *(f"Sub-structure {part.letter}: {part.source}." for part in state.structures.values()),
        *block_lines(state, state.blocks.values()),
        *map(connector_line, state.connectors.values()),
        *detached(state),
        *_keys(state),
    ]
    return "\n".join(lines)


def _keys(state: MachineState) -> Iterator[str]:
    """Describe bound keys and key presses, if there are any."""
    bound = [f"{part.id} {_bound(part)}" for part in state.powered() if any(part.bindings.values())]
    if bound:
        yield f"Keys: {' | '.join(bound)}."
    if state.control_sequence:
        yield f"Key presses: {'; '.join(_press_lines(state))}."
    if state.controller:
        yield controller(state)


def _as_a_whole(state: MachineState) -> str:
    """Describe centre of mass, inertia and outer dimensions of the machine as it is."""
    low, high = (tuple(corner) for corner in state.bounds.tolist())
    size = " x ".join(number(b - a) for a, b in zip(low, high, strict=True))
    inertia = ", ".join(number(value) for value in state.inertia.tolist())
    return (
        f"Centre of mass {point(tuple(state.center_of_mass.tolist()))}; moments of inertia about "
        f"it along x, y, z: {inertia}; outer dimensions {size}, from {point(low)} to {point(high)}."
    )


def detached(state: MachineState) -> list[str]:
    """Return a sentence about the blocks without a path to the first one, if there are any."""
    loose = state.detached()
    first = next(iter(state.blocks), "")
    return [f"Not connected to block {first}: {listing(loose)}."] if loose else []


def controller(state: MachineState) -> str:
    """Describe the controller of the trial: a program, or the keys."""
    if not state.controller:
        return "There is no controller; the control sequence is played."
    count = len(state.controller.splitlines())
    return f"The controller is set: {counted(count, 'line')}. No key press is played."


def control_sequence(state: MachineState) -> str:
    """List the control sequence, one entry per line, numbered as `remove_control_sequence` does."""
    return "\n".join(_press_lines(state)) or "The control sequence is empty."


def added_presses(state: MachineState, count: int) -> str:
    """List the last `count` entries of the control sequence, and the number of all entries."""
    entries = "entry" if len(state.control_sequence) == 1 else "entries"
    lines = "\n".join(_press_lines(state)[-count:])
    return f"Added. The sequence has {len(state.control_sequence)} {entries}.\n{lines}"


def control_config(state: MachineState) -> str:
    """List the key bindings block by block."""
    lines = [f"{part.id} {part.module.name}: {_bound(part)}" for part in state.powered()]
    return "\n".join(lines) or "No block takes a key."


def powered_blocks(state: MachineState) -> str:
    """List the blocks and connectors that take keys, with their positions and actions."""
    lines = block_lines(state, (block for block in state.blocks.values() if block.bindings))
    lines += [connector_line(link) for link in state.connectors.values() if link.bindings]
    return "\n".join(lines) or "No block is powered."


def seats(before: MachineState, after: MachineState, moved_id: str) -> list[str]:
    """Describe the joints at a block that was moved or turned.

    Args:
        before: the state before the action.
        after: the state after it.
        moved_id: id of the block; it sat where it sits.
    """
    moved = after.blocks[moved_id]
    sentences, parted = [], False
    for block in (moved, *after.children(moved)):
        joint, earlier = after.joint(block), before.joint(before.blocks[block.id])
        if joint is None or earlier is None:
            continue
        parted = parted or not joint.holds
        # The moved block's own gap is in its line already.
        if joint.offset > FLUSH_OFFSET and block is not moved:
            sentences.append(f"Block {joint.part} is {_gap(joint)}.")
        if joint.offset <= FLUSH_OFFSET < earlier.offset:
            sentences.append(f"Block {joint.part} sits flush on {joint.base}/{joint.face} again.")
    return [*sentences, NO_JOINT] if parted else sentences


def losses(before: MachineState, after: MachineState) -> list[str]:
    """Describe what an action separated: blocks from the first one, flames from cannons."""
    parted = [] if after.detached() == before.detached() else detached(after)
    return [*parted, *cooled(before, after)]


def cooled(before: MachineState, after: MachineState) -> list[str]:
    """Describe the cannons that a flame reached before an action and not after it."""
    now = heating(after)
    lost = {
        cannon: [torch for torch in torches if torch not in now[cannon]]
        for cannon, torches in heating(before).items()
        if cannon in now
    }
    return [
        f"{heading(after.blocks[cannon])} is no longer heated by {listing(torches)}."
        for cannon, torches in lost.items()
        if torches
    ]


def _bound(part: Block | Connector) -> str:
    return "; ".join(f"{action} {listing(keys)}" for action, keys in part.bindings.items())


def _press_lines(state: MachineState) -> list[str]:
    return [
        f"{index}: at {plain(press.time_s)} s hold {press.key} for {plain(press.hold_for_s)} s"
        for index, press in enumerate(state.control_sequence)
    ]


def _place_line(
    state: MachineState, block: Block, heat: Mapping[str, tuple[str, ...]], moving: Mobility
) -> str:
    facts = [
        f"{block.id} {block.module.name}",
        *_seat(block, state.joint(block)),
        f"at {point(block.center_xyz)}",
        *_use(block),
        *_heat(block, heat),
        *couplings(moving, block.id),
    ]
    return ", ".join(facts)


def _seat(block: Block, joint: Joint | None) -> list[str]:
    if joint is not None:
        flush = joint.offset <= FLUSH_OFFSET
        return [f"on {joint.base}/{joint.face}" if flush else _gap(joint)]
    return [] if block.lost_mount is None else ["on nothing"]


def _letters(state: MachineState, block: Block) -> str:
    if not block.module.faces:
        return ""
    occupied = [label for label in block.module.face_of_label if state.is_occupied(block, label)]
    suffix = f"; taken {list_faces(block, occupied)}" if occupied else ""
    return f", free faces {free_faces(state, block)}{suffix}"


def _gap(joint: Joint) -> str:
    """Describe a block's distance from its face, and the effect: "0.25 off 2/A; still holds"."""
    gap, verdict = number(joint.offset), "still holds"
    if not joint.holds:
        verdict = "no longer joined"
        # Two decimals would round a gap just beyond the reach to the reach itself.
        gap = gap if float(gap) > JOINT_REACH else plain(joint.offset)
    return f"{gap} off {joint.base}/{joint.face}; {verdict}"


def _use(block: Block) -> Iterable[str]:
    if block.module.motor is not None:
        forward = rolling(block.axis_xyz, clockwise=block.forward_is_clockwise)
        flipped = " (flipped)" if block.flipped else ""
        return [f"centre {point(block.body_center_xyz)}", forward + flipped]
    towards = block.pointing_xyz
    if towards is None:
        return motions(block)
    marks = [_landmark(block, mark) for mark in block.module.landmarks]
    return [f"points {caption(towards)}", *marks]


def _landmark(block: Block, mark: Landmark) -> str:
    radius = "" if mark.radius is None else f" radius {plain(mark.radius)}"
    return f"{mark.name} {point(block.landmark(mark.along))}{radius}"


def _heat(block: Block, heat: Mapping[str, tuple[str, ...]]) -> Iterator[str]:
    if block.id in heat:
        torches = heat[block.id]
        yield f"heated by {listing(torches)}" if torches else "not heated"
    if block.module.flames:
        cannons = [cannon for cannon, torches in heat.items() if block.id in torches]
        yield f"heats {', '.join(cannons) or 'nothing'}"


def _use_of_face(state: MachineState, block: Block, label: str) -> str:
    child = state.occupants.get((block.id, label))
    if child is not None:
        return f" holds {child}"
    if block.mount is not None and label == block.module.root_face:
        return f" sits on {block.mount[0]}/{block.mount[1]}"
    return ""


def _note(note: str) -> str:
    """Return a note on one line, cut short because every summary repeats it."""
    text = " ".join(note.split())
    if len(text) > LONGEST_NOTE:
        text = f"{text[: LONGEST_NOTE - 1]}…"
    return f" — {text}" if text else ""
