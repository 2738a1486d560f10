"""Writes the file of a machine that was read from one: as it was, where nothing was changed."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as ET

from buildarena_besiege.errors import MachineFileError
from buildarena_besiege.exporting.entries import connector_entries
from buildarena_besiege.exporting.machine_file import INDENT, entry_lines, script_entries
from buildarena_besiege.importing.blocks import keys_of, read_part
from buildarena_besiege.importing.file_data import (
    STORED_SCRIPT,
    data_entries,
    is_scripts,
    machine_data,
    part_data,
)
from buildarena_besiege.importing.xml_file import read_block, text_of, with_own_guids
from buildarena_besiege.names import key_entries
from buildarena_geometry.blocks import Block
from buildarena_geometry.keys import KEYS
from buildarena_geometry.rotations import distance

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from xml.etree.ElementTree import Element

    from buildarena_besiege.exporting.entries import Entry
    from buildarena_besiege.exporting.machine_file import BlockRecord, FileRecord
    from buildarena_besiege.importing.file_data import PartData
    from buildarena_geometry import Machine
    from buildarena_geometry.blocks import Connector
    from buildarena_geometry.poses import Pose
    from buildarena_geometry.rotations import Quaternion, Vector

_SAME: Final = 1e-9  # units, and components of quaternions


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadRecord:
    """A block as the file says it that it was read from; see `FileRecord`.

    Attributes:
        element: Its element.
    """

    part: str
    guid: str
    position: Vector
    rotation: Quaternion
    element: Element
    entries: tuple[Entry, ...] = ()

    def lines(self, indent: str) -> Iterator[str]:
        """Its element in a machine file."""
        element = copy.deepcopy(self.element)
        ET.indent(element, INDENT, level=len(indent) // len(INDENT))
        yield f"{indent}{text_of(element)}"


def has_file_data(machine: Machine) -> bool:
    """Whether a machine, or a part of it, holds what a file said of it."""
    return bool(machine.state.file_data) or any(part.file_data for part in machine.state.parts)


def restored_records(
    machine: Machine,
    records: Sequence[BlockRecord],
    keys: Mapping[str, Mapping[str, Sequence[str]]],
) -> list[FileRecord]:
    """The blocks of a machine's file as their own files say them, in their order there.

    Args:
        machine: The machine.
        records: Its blocks as they are written without file data.
        keys: The keys of each block's actions, by block id.

    Raises:
        MachineFileError: Some file data is not what a machine file says.
    """
    data = machine_data(machine)
    parts = {part.id: part for part in machine.state.parts}
    unread: list[FileRecord] = []
    read: list[tuple[int, str, Element]] = []
    for record in records:
        part = parts[record.part]
        own = part_data(part)
        if own is None:
            unread.append(record)
        else:
            element = _rewritten(machine, part, own, record, keys.get(part.id, {}))
            read.append((own.place, part.id, element))
    read += [] if data is None else [(place, "", block) for place, block in data.extras]
    read.sort(key=lambda entry: entry[0])
    # Two copies of one machine in an assembly have the same guids.
    list(with_own_guids([element for _, _, element in read]))
    return [*(_read_record(*entry) for entry in read), *unread]


def restored_text(
    machine: Machine, name: str, records: Sequence[FileRecord], script: str
) -> str | None:
    """A machine file's text with what the machine's own file had beside its blocks.

    Returns:
        None where the machine holds nothing of the kind.
    """
    data = machine_data(machine)
    if data is None:
        return None
    root = data.element
    root.set("name", name)
    for entry in data_entries(root):
        key = entry.get("key", "")
        if is_scripts(key):
            entry.set("key", f"{STORED_SCRIPT}{key}")
    own, blocks = root.find("Data"), root.find("Blocks")
    if own is None or blocks is None:
        raise MachineFileError("the file data of the machine has no Data and Blocks")
    for place, line in enumerate(script_entries(script)):
        own.insert(place, ET.fromstring("".join(entry_lines(line, ""))))  # noqa: S314  our own
    for record in records:
        blocks.append(ET.fromstring("\n".join(record.lines(""))))  # noqa: S314  see above
    ET.indent(root, INDENT)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text_of(root)}\n'


def _read_record(place: int, part: str, element: Element) -> ReadRecord:
    block = read_block(element, place)
    return ReadRecord(
        part=part,
        guid=block.guid,
        position=block.position,
        rotation=block.rotation,
        element=element,
    )


def _rewritten(
    machine: Machine,
    part: Block | Connector,
    own: PartData,
    record: BlockRecord,
    keys: Mapping[str, Sequence[str]],
) -> Element:
    """A part's element in its file, changed where the part was changed since."""
    element = copy.deepcopy(own.block.element)
    was = read_part(own.block, part.module)
    if not isinstance(part, Block):
        if own.ends != (part.start_xyz, part.end_xyz):
            _place(element, record)
            for entry in connector_entries(machine, part):
                _set(element, entry)
        return element
    if not _same(was.pose, part.world_from_block):
        _place(element, record)
    if part.module.spins and was.flipped != part.flipped:
        _set(element, ("Boolean", "flipped", part.flipped))
    of_file = {entry.key: entry for entry in own.block.entries}
    for action, name in key_entries(part.module).items():
        bound = tuple(dict.fromkeys(keys.get(action, ())))
        if was.bindings.get(action, ()) != bound:
            further = keys_of(of_file[name]) if name in of_file else ()
            others = [key for key in further if key not in KEYS]
            _set(element, ("StringArray", name, (*bound, *others)))
    return element


def _place(element: Element, record: BlockRecord) -> None:
    """Puts a block where its part is now."""
    transform = element.find("Transform")
    assert transform is not None  # noqa: S101  a block without is not read
    w, x, y, z = record.rotation
    for tag, numbers in (
        ("Position", dict(zip("xyz", record.position, strict=True))),
        ("Rotation", {"x": x, "y": y, "z": z, "w": w}),
    ):
        holder = transform.find(tag)
        if holder is None:
            holder = ET.SubElement(transform, tag)
        for axis, number in numbers.items():
            holder.set(axis, repr(number))


def _set(element: Element, entry: Entry) -> None:
    """Puts an entry in the place of the last one of its name, or behind all others."""
    new = ET.fromstring("".join(entry_lines(entry, "")))  # noqa: S314  our own
    rooms = element.findall("Data") or [ET.SubElement(element, "Data")]
    for room in reversed(rooms):
        for place, present in reversed(list(enumerate(room))):
            if present.get("key") == entry[1]:
                new.tail = present.tail
                room[place] = new
                return
    rooms[-1].append(new)


def _same(left: Pose, right: Pose) -> bool:
    turned = max(abs(a - b) for a, b in zip(left.wxyz, right.wxyz, strict=True))
    return distance(left.xyz, right.xyz) <= _SAME and turned <= _SAME
