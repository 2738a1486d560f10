"""Actions that put a machine together."""

from dataclasses import replace
from math import dist

from buildarena_geometry.actions.lookups import (
    attachable_module,
    connector_module,
    part,
    require_started,
)
from buildarena_geometry.blocks import Block, Connector, FaceRef, seated
from buildarena_geometry.changes import Change, attempted
from buildarena_geometry.feedback import state as words
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.module import Module
from buildarena_geometry.modules.parameters import BlockId, Name, Note, RefusalError, Triple, quote
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.poses import Pose, turned
from buildarena_geometry.rotations import ORIGIN
from buildarena_geometry.state import MachineState, span_in

CLOSEST_FACES = 0.01  # units; a connector between faces nearer than this has no direction


def start(
    state: MachineState,
    *,
    init_shift: Triple = ORIGIN,
    init_rotation: Triple = ORIGIN,
    note: Note = "",
) -> Change:
    """Create the starting block, block 1.

    Args:
        init_shift: Position of the block's centre [east, north, up]; [0, 0, 0] if left out.
        init_rotation: [yaw, pitch, roll] in degrees: yaw turns north to east, pitch north down,
            roll up to east.
        note: What this machine is, in your words.
    """
    if state.is_assembly:
        text = f"An assembly begins with add_machine. Machines: {listing(state.available)}."
        raise RefusalError(Cause.UNKNOWN_ACTION, text)
    if state.started:
        text = "The machine has its starting block, block 1; reset starts anew."
        raise RefusalError(Cause.ALREADY_STARTED, text)
    pose = Pose(position=init_shift, quaternion=turned(init_rotation))
    block = _new_block(state, state.catalogue.start, pose, note)
    after = replace(state, blocks={block.id: block}, next_id=state.next_id + 1)
    return Change(
        after=after, placed=(block.id,), render=lambda: f"Started. {words.placement(after, block)}"
    )


def attach_block_to(
    state: MachineState, *, base_block: BlockId, face: Name, new_block: Name, note: Note = ""
) -> Change:
    """Attach a new block to a free face of a block.

    Args:
        base_block: Id of the block that carries the new one.
        face: Label of the base block's face, such as "A".
        new_block: Name of the module to attach; connectors go in with connect_blocks.
        note: What it is for, in your words.
    """
    require_started(state)
    module = attachable_module(state, new_block)
    base = part(state, base_block)
    if isinstance(base, Connector) or face not in base.module.face_of_label:
        free = words.free_faces(state, base) if isinstance(base, Block) else "none"
        text = f"{words.heading(base)} has no face {quote(face)}. Its free faces: {free}."
        raise RefusalError(Cause.NO_SUCH_FACE, text)
    pose = seated(base.world_from_face(face), module)
    block = _new_block(state, module, pose, note)
    block = replace(block, mount=(base.id, face), structure=base.structure)
    if state.is_occupied(base, face):
        fault = f"Face {words.face_name(base, face)} of {words.title(base)} is taken"
        text = f"{fault}. Its free faces: {words.free_faces(state, base)}."
        raise RefusalError(Cause.FACE_OCCUPIED, text, attempted=attempted([block]))
    after = replace(
        state,
        blocks={**state.blocks, block.id: block},
        occupants={**state.occupants, (base.id, face): block.id},
        next_id=state.next_id + 1,
    )
    return Change(
        after=after,
        placed=(block.id,),
        attempt=f"A {module.name} on face {face} of block {base.id}",
        render=lambda: f"Attached. {words.placement(after, block)}",
    )


def connect_blocks(
    state: MachineState,
    *,
    block_a: BlockId,
    face_a: Name,
    block_b: BlockId,
    face_b: Name,
    connector: Name,
    note: Note = "",
) -> Change:
    """Join two faces of existing blocks with a connector; the faces may be taken.

    Args:
        block_a: Id of the block where the connector begins.
        face_a: Label of the face of block_a.
        block_b: Id of the block where it ends.
        face_b: Label of the face of block_b.
        connector: Name of the connector.
        note: What it is for, in your words.
    """
    require_started(state)
    module = connector_module(state, connector)
    parts = (part(state, block_a), part(state, block_b))
    start_block, end_block = _with_face(parts[0], face_a), _with_face(parts[1], face_b)
    start_xyz, end_xyz = start_block.face_center(face_a), end_block.face_center(face_b)
    _check_distance((start_block, face_a), (end_block, face_b), dist(start_xyz, end_xyz))
    link = linked(state, module, (start_block.id, face_a), (end_block.id, face_b), note)
    after = replace(state.with_connector(link), next_id=state.next_id + 1)
    return Change(
        after=after,
        touched=(link.id,),
        render=lambda: f"Connected. {words.connector_line(link)}.{words.idle(link)}",
    )


def linked(
    state: MachineState, module: Module, start: FaceRef, end: FaceRef, note: str
) -> Connector:
    """Return a new connector between two faces, with the state's next id."""
    block = state.blocks[start[0]]
    pose = block.world_from_face(start[1])
    ends = block.face_center(start[1]), state.blocks[end[0]].face_center(end[1])
    return Connector(
        id=str(state.next_id),
        module=module,
        start=start,
        end=end,
        start_xyz=ends[0],
        end_xyz=ends[1],
        world_from_connector=pose,
        span=span_in(pose, *ends),
        bindings=dict.fromkeys(module.actions, ()),
        structure=block.structure,
        note=note,
    )


def _new_block(state: MachineState, module: Module, pose: Pose, note: str) -> Block:
    return Block(
        id=str(state.next_id),
        module=module,
        world_from_block=pose,
        bindings=dict.fromkeys(module.actions, ()),
        note=note,
    )


def _with_face(part: Block | Connector, label: str) -> Block:
    if isinstance(part, Connector) or not part.module.faces:
        raise RefusalError(Cause.NO_FACES, f"{words.heading(part)} has no faces to connect.")
    if label not in part.module.face_of_label:
        choices = words.list_faces(part, part.module.face_of_label)
        text = f"{words.heading(part)} has no face {quote(label)}. Its faces: {choices}."
        raise RefusalError(Cause.NO_SUCH_FACE, text)
    return part


def _check_distance(left: tuple[Block, str], right: tuple[Block, str], distance: float) -> None:
    if distance >= CLOSEST_FACES:
        return
    (a, face_a), (b, face_b) = left, right
    pair = f"{a.id}/{face_a} and {b.id}/{face_b}"
    if _sits_on(a, face_a, b, face_b) or _sits_on(b, face_b, a, face_a):
        text = f"{pair} are attached to each other already. Connect other faces to reinforce them."
        raise RefusalError(Cause.EXCESS_CONNECTION, text)
    text = f"{pair} are at the same place. A connector needs faces at least {CLOSEST_FACES} apart."
    raise RefusalError(Cause.TOO_CLOSE, text)


def _sits_on(part_block: Block, part_face: str, base: Block, base_face: str) -> bool:
    return part_block.mount == (base.id, base_face) and part_face == part_block.module.root_face
