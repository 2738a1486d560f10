"""Reads machine documents, and refuses those that are not a sound machine."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Annotated, Any

from msgspec import Meta

from buildarena_geometry.actions.parameters import LARGEST_NUMBER, LONGEST_TEXT
from buildarena_geometry.blocks import Block, Connector, FaceRef, KeyPress
from buildarena_geometry.collision import CollisionWorld, unwanted
from buildarena_geometry.documents.log import ActionRecord, LoggedState
from buildarena_geometry.documents.write import DOCUMENT_VERSION
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.json_values import check_controller
from buildarena_geometry.keys import KEYS
from buildarena_geometry.modules.module import Catalogue, Module
from buildarena_geometry.modules.sets import module_set, modules_of_action, smallest_set
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import SHORTEST_QUATERNION
from buildarena_geometry.state import MachineState, SubStructure
from buildarena_geometry.struct_reader import FieldError, Finite, Form, Point, Whole, read, refuse

Text = Annotated[str, Meta(max_length=LONGEST_TEXT)]


class _Entry(Form, frozen=True, kw_only=True):
    """Fields shared by entries of blocks and connectors."""

    id: Text
    module: str
    position: Point
    quaternion: tuple[Finite, Finite, Finite, Finite]
    bindings: dict[str, tuple[str, ...]] | None = None
    structure: Text | None = None
    note: Text | None = None

    def __post_init__(self) -> None:
        """Refuse positions outside the world, and quaternions that are not rotations."""
        # A connector may begin on a face a little beyond the farthest block's root.
        if max(map(abs, self.position)) > 2 * LARGEST_NUMBER:
            refuse("position", f"a position within ±{LARGEST_NUMBER:.0f}", self.position)
        if abs(sum(value * value for value in self.quaternion) - 1) > SHORTEST_QUATERNION:
            refuse("quaternion", "a quaternion of length 1", self.quaternion)


class _BlockEntry(_Entry, frozen=True, kw_only=True):
    mount: FaceRef | None = None
    lost_mount: FaceRef | None = None
    flipped: bool | None = None


class _ConnectorEntry(_Entry, frozen=True, kw_only=True):
    start: FaceRef
    end: FaceRef
    span: Point


class _Document(Form, frozen=True, kw_only=True):
    version: Whole
    blocks: tuple[_BlockEntry, ...]
    joints: Any
    connectors: tuple[_ConnectorEntry, ...]
    control_sequence: tuple[KeyPress, ...]
    structures: tuple[SubStructure, ...]
    structures_made: Whole
    next_id: Whole
    available: dict[str, Any]
    log: tuple[ActionRecord, ...]
    controller: str | None = None


def read_machine(
    document: object,
    *,
    catalogue: Catalogue | None = None,
    where: str = "document",
    overlaps: bool = False,
) -> LoggedState:
    """Return the machine that a document describes, with its log.

    Args:
        document: JSON values.
        catalogue: modules that it may use. By default all types are known, and the machine gets the
            smallest set that has all of its modules.
        where: name of the document in messages.
        overlaps: true if blocks may overlap, as in other programs' machines; the actions of this
            library never make such a machine.

    Raises:
        DocumentError: it is not a machine; the message names the entry.
    """
    modules = module_set("all") if catalogue is None else catalogue
    entries = read(document, _Document, where=where, error=DocumentError)
    available: dict[str, LoggedState] = {}
    for name, inner in entries.available.items():
        place = f"{where}.available.{name}"
        available[name] = read_machine(inner, catalogue=catalogue, where=place, overlaps=overlaps)
    try:
        state = _state(entries, modules, {name: held.state for name, held in available.items()})
        _check_whole(state)
        if not overlaps:
            _check_apart(state)
    except FieldError as misfit:
        raise DocumentError(f"{where}{misfit}") from None
    if catalogue is None:
        state = replace(state, catalogue=smallest_set(_used(state, entries.log)))
    return LoggedState(state=state, records=entries.log, available=available)


def _state(
    document: _Document, catalogue: Catalogue, available: dict[str, MachineState]
) -> MachineState:
    if document.version != DOCUMENT_VERSION:
        refuse("version", f"version {DOCUMENT_VERSION}", document.version)
    try:
        check_controller(document.controller or "")
    except ValueError as error:
        raise FieldError(f".controller: {error}") from None
    blocks = _read_blocks(document.blocks, catalogue)
    structures = {structure.letter: structure for structure in document.structures}
    for index, structure in enumerate(document.structures):
        root = structure.root
        if root not in blocks or blocks[root].module.kind != "start":
            refuse(f"structures[{index}].root", "the id of a starting block", root)
    if document.structures_made < len(structures):
        expected = f"a whole number of at least {len(structures)}"
        refuse("structures_made", expected, document.structures_made)
    for index, press in enumerate(document.control_sequence):
        _check_choice(f"control_sequence[{index}].key", press.key, KEYS)
    return MachineState(
        catalogue=catalogue,
        available=available,
        blocks=blocks,
        connectors=_read_connectors(document.connectors, catalogue, blocks),
        occupants={block.mount: block.id for block in blocks.values() if block.mount is not None},
        structures=structures,
        structures_made=document.structures_made,
        control_sequence=document.control_sequence,
        controller=document.controller or "",
        next_id=document.next_id,
    )


def _used(state: MachineState, records: Iterable[ActionRecord]) -> Iterator[str]:
    """Yield the modules that a machine contains, contained, or may be assembled from."""
    for machine in (state, *state.available.values()):
        yield from (part.module.name for part in machine.parts)
    for record in records:
        if record.reason is None and isinstance(record.arguments, dict):
            yield from (module.name for module in modules_of_action(record.arguments))


def _read_blocks(entries: Iterable[_BlockEntry], catalogue: Catalogue) -> dict[str, Block]:
    unplaced = ("connector", "cargo")
    placeable = [name for name, module in catalogue.items() if module.kind not in unplaced]
    blocks: dict[str, Block] = {}
    used: set[FaceRef] = set()
    for index, entry in enumerate(entries):
        place = f"blocks[{index}]"
        _check_choice(f"{place}.module", entry.module, placeable)
        block = _block(entry, catalogue[entry.module], place)
        if block.id in blocks:
            raise FieldError(f".{place}.id: a block {block.id!r} exists already")
        if block.mount is not None:
            # A block is attached to one that is there, so its base always comes first.
            _check_face(block.mount, blocks, f"{place}.mount")
            base, label = blocks[block.mount[0]], block.mount[1]
            if block.mount in used or (base.mount is not None and label == base.module.root_face):
                raise FieldError(f".{place}.mount: face {label} of block {base.id} is used twice")
            used.add(block.mount)
        blocks[block.id] = block
    return blocks


def _block(entry: _BlockEntry, module: Module, place: str) -> Block:
    if entry.mount is not None and module.kind == "start":
        refuse(f"{place}.mount", "null: a starting block sits on nothing", entry.mount)
    if entry.flipped and not module.spins:
        refuse(f"{place}.flipped", f"false: a {module.name} does not spin", entry.flipped)
    return Block(
        **_shared(entry, module, place),
        world_from_block=Pose(position=entry.position, quaternion=entry.quaternion),
        mount=entry.mount,
        lost_mount=entry.lost_mount,
        flipped=bool(entry.flipped),
    )


def _shared(entry: _Entry, module: Module, place: str) -> dict[str, Any]:
    """Return the fields that blocks and connectors share."""
    return {
        "id": entry.id,
        "module": module,
        "bindings": _bindings(entry, module, place),
        "structure": entry.structure or "",
        "note": entry.note or "",
    }


def _bindings(entry: _Entry, module: Module, place: str) -> dict[str, tuple[str, ...]]:
    bindings: dict[str, tuple[str, ...]] = dict.fromkeys(module.actions, ())
    for action, keys in (entry.bindings or {}).items():
        if action not in bindings:
            raise FieldError(f".{place}.bindings.{action}: a {module.name} has no such action")
        for index, key in enumerate(keys):
            _check_choice(f"{place}.bindings.{action}[{index}]", key, KEYS)
        bindings[action] = keys
    return bindings


def _read_connectors(
    entries: Iterable[_ConnectorEntry], catalogue: Catalogue, blocks: Mapping[str, Block]
) -> dict[str, Connector]:
    connectors: dict[str, Connector] = {}
    for index, entry in enumerate(entries):
        place, start, end = f"connectors[{index}]", entry.start, entry.end
        _check_face(start, blocks, f"{place}.start")
        _check_face(end, blocks, f"{place}.end")
        _check_choice(f"{place}.module", entry.module, catalogue.connectors)
        if entry.id in connectors or entry.id in blocks:
            raise FieldError(f".{place}.id: a part {entry.id!r} exists already")
        connectors[entry.id] = Connector(
            **_shared(entry, catalogue[entry.module], place),
            start=start,
            end=end,
            start_xyz=blocks[start[0]].face_center(start[1]),
            end_xyz=blocks[end[0]].face_center(end[1]),
            world_from_connector=Pose(position=entry.position, quaternion=entry.quaternion),
            span=entry.span,
        )
    return connectors


def _check_whole(state: MachineState) -> None:
    """Refuse documents whose entries are each valid but inconsistent together."""
    for part in (*state.blocks, *state.connectors):
        if part.isdecimal() and int(part) >= state.next_id:
            refuse("next_id", f"a number above every id, such as {part}", state.next_id)
    starts = [block for block in state.blocks.values() if block.module.kind == "start"]
    root_count = len(state.structures) if state.available else min(1, len(state.blocks))
    if len(starts) != root_count or (starts and next(iter(state.blocks)) != starts[0].id):
        expected = f"expected {root_count} starting block, at its head"
        raise FieldError(f".blocks: {expected}, found {len(starts)}")
    for block in state.blocks.values():
        if block.structure != "" and block.structure not in state.structures:
            raise FieldError(f".blocks: block {block.id} is of an unknown sub-structure")


def _check_apart(state: MachineState) -> None:
    world = CollisionWorld()
    for block in state.blocks.values():
        overlaps = unwanted(world.overlaps([block]), state.blocks)
        if overlaps:
            pair = overlaps[0]
            raise FieldError(f".blocks: blocks {pair.other} and {pair.block} overlap")
        world.place([block])


def _check_face(face: FaceRef, blocks: Mapping[str, Block], place: str) -> None:
    block_id, label = face
    if block_id not in blocks:
        raise FieldError(f".{place}: block {block_id!r} does not come before it")
    labels = blocks[block_id].module.face_of_label
    if label not in labels:
        choices = f"its faces: {listing(labels)}"
        raise FieldError(f".{place}: block {block_id} has no face {label!r}; {choices}")


def _check_choice(place: str, value: str, choices: Collection[str]) -> None:
    if value not in choices:
        refuse(place, f"one of {', '.join(choices)}", value)
