"""Reads machine documents, and refuses those that are not a sound machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from buildarena_geometry.blocks import Block, Connector, FaceRef, KeyPress
from buildarena_geometry.collision import CollisionWorld, unwanted
from buildarena_geometry.documents.log import ActionRecord, LoggedState
from buildarena_geometry.documents.write import DOCUMENT_VERSION
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.keys import KEYS
from buildarena_geometry.modules.parameters import LARGEST_NUMBER, LONGEST_TEXT
from buildarena_geometry.modules.sets import module_set, modules_of_action, smallest_set
from buildarena_geometry.outcomes import RefusalClass
from buildarena_geometry.poses import Pose
from buildarena_geometry.reading import Fields, Reader
from buildarena_geometry.rotations import SHORTEST_QUATERNION
from buildarena_geometry.state import MachineState, SubStructure

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from buildarena_geometry.modules.module import Catalogue, Module

_FIELDS = (
    "version",
    "blocks",
    "joints",
    "connectors",
    "control_sequence",
    "structures",
    "structures_made",
    "next_id",
    "available",
    "log",
)
_BLOCK = ("id", "module", "position", "quaternion")
_BLOCK_OPTIONAL = ("mount", "lost_mount", "flipped", "bindings", "structure", "note")
_CONNECTOR = ("id", "module", "start", "end", "position", "quaternion", "span")


def read_machine(
    document: object,
    *,
    catalogue: Catalogue | None = None,
    where: str = "document",
    overlaps: bool = False,
) -> LoggedState:
    """The machine a document describes, with its log.

    Args:
        document: JSON values.
        catalogue: the modules it is made of; if left out, all types are known, and the machine goes
            on with the smallest set that has those it is made of.
        where: what messages call the document.
        overlaps: whether blocks may overlap, as those of other programs' machines do; the actions
            of this library never make such a machine.

    Raises:
        DocumentError: it is not a machine; the message names the entry.
    """
    known = module_set("all") if catalogue is None else catalogue
    fields = Reader(value=document, where=where, error=DocumentError).fields(required=_FIELDS)
    if fields["version"].integer() != DOCUMENT_VERSION:
        fields["version"].fail(f"version {DOCUMENT_VERSION}")
    available = {
        name: read_machine(entry.value, catalogue=catalogue, where=entry.where, overlaps=overlaps)
        for name, entry in fields["available"].entries()
    }
    blocks = _read_blocks(fields["blocks"], known)
    connectors = _read_connectors(fields["connectors"], known, blocks)
    structures = _read_structures(fields["structures"], blocks)
    records = tuple(_record(entry) for entry in fields["log"].items())
    if catalogue is None:
        catalogue = smallest_set(_used(blocks, connectors, available, records))
    state = MachineState(
        catalogue=catalogue,
        available={name: machine.state for name, machine in available.items()},
        blocks=blocks,
        connectors=connectors,
        occupants={block.mount: block.id for block in blocks.values() if block.mount is not None},
        structures=structures,
        structures_made=fields["structures_made"].integer(least=len(structures)),
        control_sequence=tuple(_press(entry) for entry in fields["control_sequence"].items()),
        next_id=fields["next_id"].integer(least=1),
    )
    _check_whole(state, fields)
    if not overlaps:
        _check_apart(state, fields)
    return LoggedState(state=state, records=records, available=available)


def _used(
    blocks: Mapping[str, Block],
    connectors: Mapping[str, Connector],
    available: Mapping[str, LoggedState],
    records: Iterable[ActionRecord],
) -> Iterator[str]:
    """The modules that a machine is made of, was made of, and may be assembled from."""
    yield from (block.module.name for block in blocks.values())
    yield from (link.module.name for link in connectors.values())
    for machine in available.values():
        yield from (part.module.name for part in machine.state.parts)
    for record in records:
        if record.reason is None and isinstance(record.arguments, dict):
            yield from (module.name for module in modules_of_action(record.arguments))


def _read_blocks(entries: Reader, catalogue: Catalogue) -> dict[str, Block]:
    blocks: dict[str, Block] = {}
    used: set[FaceRef] = set()
    for entry in entries.items():
        block = _block(entry, catalogue)
        if block.id in blocks:
            raise DocumentError(f"{entry.where}.id: a block {block.id!r} exists already")
        if block.mount is not None:
            # A block is attached to one that is there, so its base always comes first.
            place = f"{entry.where}.mount"
            _check_face(block.mount, blocks, place)
            base, label = blocks[block.mount[0]], block.mount[1]
            if block.mount in used or (base.mount is not None and label == base.module.root_face):
                raise DocumentError(f"{place}: face {label} of block {base.id} is used twice")
            used.add(block.mount)
        blocks[block.id] = block
    return blocks


def _block(entry: Reader, catalogue: Catalogue) -> Block:
    fields = entry.fields(required=_BLOCK, optional=_BLOCK_OPTIONAL)
    placeable = [
        name for name, kind in catalogue.items() if kind.kind not in ("connector", "cargo")
    ]
    module = catalogue[fields["module"].choice(placeable)]
    mount = _face(fields["mount"]) if fields.has("mount") else None
    if mount is not None and module.kind == "start":
        fields["mount"].fail("null: a starting block sits on nothing")
    return Block(
        id=fields["id"].text(longest=LONGEST_TEXT),
        module=module,
        world_from_block=_pose(fields),
        mount=mount,
        lost_mount=_face(fields["lost_mount"]) if fields.has("lost_mount") else None,
        flipped=_flipped(fields, module),
        bindings=_bindings(fields, module),
        structure=_optional_text(fields, "structure"),
        note=_optional_text(fields, "note"),
    )


def _flipped(fields: Fields, module: Module) -> bool:
    flipped = fields["flipped"].truth() if fields.has("flipped") else False
    if flipped and not module.spins:
        fields["flipped"].fail(f"false: a {module.name} does not spin")
    return flipped


def _bindings(fields: Fields, module: Module) -> dict[str, tuple[str, ...]]:
    bindings: dict[str, tuple[str, ...]] = dict.fromkeys(module.actions, ())
    if fields.has("bindings"):
        for action, keys in fields["bindings"].entries():
            if action not in bindings:
                raise DocumentError(f"{keys.where}: a {module.name} has no such action")
            bindings[action] = tuple(key.choice(KEYS) for key in keys.items())
    return bindings


def _read_connectors(
    entries: Reader, catalogue: Catalogue, blocks: Mapping[str, Block]
) -> dict[str, Connector]:
    connectors: dict[str, Connector] = {}
    for entry in entries.items():
        fields = entry.fields(required=_CONNECTOR, optional=("bindings", "structure", "note"))
        start, end = _face(fields["start"]), _face(fields["end"])
        for face, name in ((start, "start"), (end, "end")):
            _check_face(face, blocks, f"{entry.where}.{name}")
        module = catalogue[fields["module"].choice(catalogue.connectors)]
        link = Connector(
            id=fields["id"].text(longest=LONGEST_TEXT),
            module=module,
            start=start,
            end=end,
            start_xyz=blocks[start[0]].face_center(start[1]),
            end_xyz=blocks[end[0]].face_center(end[1]),
            world_from_connector=_pose(fields),
            span=fields["span"].vector(),
            bindings=_bindings(fields, module),
            structure=_optional_text(fields, "structure"),
            note=_optional_text(fields, "note"),
        )
        if link.id in connectors or link.id in blocks:
            raise DocumentError(f"{entry.where}.id: a part {link.id!r} exists already")
        connectors[link.id] = link
    return connectors


def _read_structures(entries: Reader, blocks: Mapping[str, Block]) -> dict[str, SubStructure]:
    structures: dict[str, SubStructure] = {}
    for entry in entries.items():
        fields = entry.fields(required=("letter", "source", "root"))
        root = fields["root"].text()
        if root not in blocks or blocks[root].module.kind != "start":
            fields["root"].fail("the id of a starting block")
        letter = fields["letter"].text()
        structures[letter] = SubStructure(letter=letter, source=fields["source"].text(), root=root)
    return structures


def _check_whole(state: MachineState, fields: Fields) -> None:
    """Refuses documents whose entries are good one by one and make no machine together."""
    where = fields["blocks"].where
    parts = (*state.blocks, *state.connectors)
    for part in parts:
        if part.isdecimal() and int(part) >= state.next_id:
            fields["next_id"].fail(f"a number above every id, such as {part}")
    starts = [block for block in state.blocks.values() if block.module.kind == "start"]
    wanted = len(state.structures) if state.available else min(1, len(state.blocks))
    if len(starts) != wanted or (starts and next(iter(state.blocks)) != starts[0].id):
        raise DocumentError(
            f"{where}: expected {wanted} starting block, at its head, found {len(starts)}"
        )
    for block in state.blocks.values():
        if block.structure != "" and block.structure not in state.structures:
            raise DocumentError(f"{where}: block {block.id} is of an unknown sub-structure")


def _check_apart(state: MachineState, fields: Fields) -> None:
    where = fields["blocks"].where
    world = CollisionWorld()
    for block in state.blocks.values():
        pairs = unwanted(world.overlaps([block]), state.blocks)
        if pairs:
            raise DocumentError(f"{where}: blocks {pairs[0][1]} and {pairs[0][0]} overlap")
        world.place([block])


def _check_face(face: FaceRef, blocks: Mapping[str, Block], where: str) -> None:
    block_id, label = face
    if block_id not in blocks:
        raise DocumentError(f"{where}: there is no block {block_id!r} before it")
    labels = blocks[block_id].module.face_of_label
    if label not in labels:
        raise DocumentError(
            f"{where}: block {block_id} has no face {label!r}; its faces: {listing(labels)}"
        )


def _face(entry: Reader) -> FaceRef:
    names = [part.text() for part in entry.items()]
    if len(names) != 2:  # noqa: PLR2004  a block and one of its faces
        entry.fail("a block's id and a face's label")
    return (names[0], names[1])


def _pose(fields: Fields) -> Pose:
    position, quaternion = fields["position"].vector(), fields["quaternion"].numbers(4)
    # A connector may begin on a face a little beyond the farthest block's root.
    if max(map(abs, position)) > 2 * LARGEST_NUMBER:
        fields["position"].fail(f"a position within ±{LARGEST_NUMBER:.0f}")
    if abs(sum(value * value for value in quaternion) - 1) > SHORTEST_QUATERNION:
        fields["quaternion"].fail("a quaternion of length 1")
    return Pose(position=position, quaternion=quaternion)


def _press(entry: Reader) -> KeyPress:
    fields = entry.fields(required=("time_s", "key", "hold_for_s"))
    return KeyPress(
        time_s=fields["time_s"].number(least=0),
        key=fields["key"].choice(KEYS),
        hold_for_s=fields["hold_for_s"].number(above=0),
    )


def _record(entry: Reader) -> ActionRecord:
    fields = entry.fields(required=("name", "arguments"), optional=("reason",))
    reason = fields["reason"].choice(list(RefusalClass)) if fields.has("reason") else None
    return ActionRecord(
        name=fields["name"].text(),
        arguments=fields["arguments"].value,
        reason=None if reason is None else RefusalClass(reason),
    )


def _optional_text(fields: Fields, name: str) -> str:
    return fields[name].text(longest=LONGEST_TEXT) if fields.has(name) else ""
