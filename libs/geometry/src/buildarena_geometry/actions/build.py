"""Actions that put a machine together, mirror parts of it, and take parts away."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import dist

from buildarena_geometry.actions.lookups import (
    attachable_module,
    connector_module,
    part,
    require_started,
)
from buildarena_geometry.actions.parameters import (
    BlockId,
    BlockIds,
    Name,
    Note,
    Plane,
    RefusalError,
    Triple,
    quote,
)
from buildarena_geometry.blocks import Block, Connector, FaceRef, seated
from buildarena_geometry.feedback import state as words
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.joints import UP
from buildarena_geometry.modules.module import Module
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.poses import Pose, turned
from buildarena_geometry.rotations import ORIGIN, Vector, dot
from buildarena_geometry.state import Change, MachineState, span_in

_SAME = 1e-6  # units; places that are nearer to each other are one
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
    if state.available:
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
        raise RefusalError(Cause.FACE_OCCUPIED, text, attempted=(block,))
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


def mirror(state: MachineState, *, plane: Plane, block_ids: BlockIds = ()) -> Change:
    """Add mirror images of blocks and of connectors between them, with their keys.

    Wheels and driven hinges turn the same way under the same key.

    Args:
        plane: "x" swaps east and west, "y" north and south, about the starting block's centre.
        block_ids: Default: all blocks that are not on the plane.
    """
    require_started(state)
    chosen = [part(state, block_id) for block_id in block_ids or state.blocks]
    reflection = _Reflection(plane=plane, origin=next(iter(state.blocks.values())).center_xyz)
    after, images = state, dict[str, str]()
    for block in state.blocks.values():
        if dist(block.center_xyz, reflection.point(block.center_xyz)) < _SAME:
            images[block.id] = block.id
        elif block in chosen:
            image = str(after.next_id)
            after = _with_image(after, block, images, reflection)
            images[block.id] = image
    placed = tuple(image for block_id, image in images.items() if image != block_id)
    if not placed:
        text = "There is nothing to mirror: name blocks that are not on the plane."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    for link in state.connectors.values():
        if all(end in images for end in link.ends) and any(images[e] in placed for e in link.ends):
            ends = [_image_of(after, end, images, reflection) for end in (link.start, link.end)]
            connector = linked(after, link.module, ends[0], ends[1], link.note)
            connector = replace(connector, bindings=link.bindings)
            after = replace(after.with_connector(connector), next_id=after.next_id + 1)
    links = [link for id_, link in after.connectors.items() if id_ not in state.connectors]
    blocks = [after.blocks[block_id] for block_id in placed]
    return Change(
        after=after,
        placed=placed,
        touched=tuple(link.id for link in links),
        attempt="The mirror image",
        render=lambda: "\n".join(
            [
                "Mirrored.",
                *words.block_lines(after, blocks, with_faces=True),
                *map(words.connector_line, links),
            ]
        ),
    )


def remove_block(state: MachineState, block_id: BlockId) -> Change:
    """Remove a block or connector; blocks on it stay.

    Args:
        block_id: Id of the block or connector.
    """
    gone = part(state, block_id)
    links: tuple[str, ...] = ()
    if isinstance(gone, Connector):
        connectors = {key: link for key, link in state.connectors.items() if key != gone.id}
        after = replace(state, connectors=connectors)
    elif gone.module.kind == "start":
        text = f"{words.heading(gone)} can't be removed; reset starts anew."
        raise RefusalError(Cause.START_BLOCK, text)
    else:
        after, links = without(state, [gone])

    def render() -> str:
        return " ".join([f"Removed {words.title(gone)}.", *removal_sentences(state, after, links)])

    return Change(after=after, removed=(gone.id, *links), render=render)


def reset(state: MachineState) -> Change:
    """Remove everything."""
    after = MachineState(catalogue=state.catalogue, available=state.available)
    return Change(
        after=after,
        removed=(*state.blocks, *state.connectors),
        render=lambda: "Everything is removed; ids start at 1 again.",
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reflection:
    """A reflection over a vertical plane through a point, across x or y."""

    plane: str
    origin: Vector

    def point(self, point: Vector) -> Vector:
        (x, y, z), (east, north, _) = point, self.origin
        return (2 * east - x, y, z) if self.plane == "x" else (x, 2 * north - y, z)

    def pose(self, pose: Pose) -> Pose:
        """Return the mirrored pose of a block that is symmetric about its own plane x = 0."""
        w, x, y, z = pose.wxyz
        turn = (w, x, -y, -z) if self.plane == "x" else (z, y, x, w)
        return Pose(position=self.point(pose.xyz), quaternion=turn)


def _with_image(
    state: MachineState, block: Block, images: Mapping[str, str], reflection: _Reflection
) -> MachineState:
    module, mount = block.module, block.mount
    if module.center[0] or (module.wing is not None and module.wing.pitch_deg):
        text = f"{words.heading(block)} has no mirror image: it is not symmetric."
        raise RefusalError(Cause.OUT_OF_RANGE, text)
    if mount is None or mount[0] not in images:
        base = "no block" if mount is None else f"block {mount[0]}, which is not mirrored"
        text = f"{words.heading(block)} is attached to {base}. Mirror that block too."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    face = _image_of(state, mount, images, reflection)
    if state.is_occupied(state.blocks[face[0]], face[1]):
        text = f"Face {face[0]}/{face[1]} is taken, so {words.title(block)} cannot be mirrored."
        raise RefusalError(Cause.FACE_OCCUPIED, text)
    pose, axis = reflection.pose(block.world_from_block), module.joint.axis if module.joint else UP
    turned_round = dot(block.world_from_block.direction(axis), pose.direction(axis)) < 0.0
    image = replace(
        block,
        id=str(state.next_id),
        world_from_block=pose,
        mount=face,
        flipped=block.flipped != (module.spins and turned_round),
        structure=state.blocks[face[0]].structure,
    )
    return replace(
        state,
        blocks={**state.blocks, image.id: image},
        occupants={**state.occupants, face: image.id},
        next_id=state.next_id + 1,
    )


def _image_of(
    state: MachineState, face: FaceRef, images: Mapping[str, str], reflection: _Reflection
) -> FaceRef:
    """Return the face at the mirror image of a face, on the image of its block."""
    target = reflection.point(state.blocks[face[0]].face_center(face[1]))
    image = state.blocks[images[face[0]]]
    for label in image.module.face_of_label:
        if dist(image.face_center(label), target) < _SAME:
            return image.id, label
    text = f"{words.heading(image)} is not symmetric about the plane."
    raise RefusalError(Cause.OUT_OF_RANGE, text)


def without(state: MachineState, gone: list[Block]) -> tuple[MachineState, tuple[str, ...]]:
    """Return the state without some blocks and the connectors that end on them.

    Returns:
        The state, in which the faces they used are open and blocks that sat on them sit on nothing,
        and the ids of the connectors that went too.
    """
    ids = {block.id for block in gone}
    blocks = {key: block for key, block in state.blocks.items() if key not in ids}
    occupants = dict(state.occupants)
    for block in gone:
        if block.mount is not None:
            occupants.pop(block.mount, None)
        for child in state.children(block):
            if child.id in blocks:
                blocks[child.id] = replace(child, mount=None, lost_mount=child.mount)
        for face in block.module.faces:
            occupants.pop((block.id, face.label), None)
    links = tuple(link.id for link in state.connectors.values() if not ids.isdisjoint(link.ends))
    connectors = {key: link for key, link in state.connectors.items() if key not in links}
    return replace(state, blocks=blocks, occupants=occupants, connectors=connectors), links


def removal_sentences(
    before: MachineState, after: MachineState, links: tuple[str, ...]
) -> list[str]:
    """Describe the parts that a removal took along, left unattached, and cooled."""
    went = [f"Connectors that ended on it went too: {listing(links)}."] if links else []
    return [*went, *words.detached(after), *words.cooled(before, after)]
