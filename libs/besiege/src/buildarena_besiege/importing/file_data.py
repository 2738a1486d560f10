"""What a machine file says beyond the machine: stored with it as XML, told in sentences.

Each part holds the element it was read from, the machine the rest of the file. No simulator and no
scorer reads any of it; `plain_machine_file` writes it again.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as ET

from buildarena_besiege.errors import MachineFileError
from buildarena_besiege.importing.blocks import differences
from buildarena_besiege.importing.xml_file import (
    FileBlock,
    FileMachine,
    parsed,
    read_block,
    read_entries,
    shown,
    text_of,
    without_blanks,
)
from buildarena_geometry.blocks import Block
from buildarena_geometry.documents.read import MAX_FILE_DATA

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

    from buildarena_besiege.importing.blocks import Remarks
    from buildarena_geometry import Machine
    from buildarena_geometry.blocks import Connector
    from buildarena_geometry.documents.log import LoggedState
    from buildarena_geometry.rotations import Vector

VERSION: Final = "1"
STORED_SCRIPT: Final = "buildarena.stored."
"""Leads the names of the entries of a script that is not ours, which no mod runs under it."""

_SCRIPT: Final = "lua"
_MAX_LINES: Final = 200
_UNTURNED: Final = {"x": "0", "y": "0", "z": "0", "w": "1"}


@dataclass(frozen=True, slots=True, kw_only=True)
class PartData:
    """The file data of a block or connector.

    Attributes:
        place: which of the file's blocks it was, from 1.
        block: what the file says of it.
        ends: of a connector: where it joined the faces when it was read, world frame, units.
    """

    place: int
    block: FileBlock
    ends: tuple[Vector, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineData:
    """The file data of a machine beside that of its parts.

    Attributes:
        element: the file's root: its attributes but the name, its place, its own data; no blocks.
        extras: the blocks that are no parts of the machine, each with its place in the file.
    """

    element: Element
    extras: tuple[tuple[int, Element], ...]


def with_file_data(
    logged: LoggedState,
    file: FileMachine,
    ids: Mapping[int, str],
    remarks: Remarks,
    *,
    scripted_by_us: bool,
) -> LoggedState:
    """A machine that holds what its file says.

    Args:
        logged: The machine without it.
        file: The file.
        ids: Of the file's blocks, by their numbers, those that may be parts of the machine.
        remarks: Gets a sentence where there is too much to hold.
        scripted_by_us: Whether the script in the file is ours, and is not held.
    """
    state = logged.state
    texts: dict[str, str] = {}
    extras = []
    for block in file.blocks:
        part_id = ids.get(block.number, "")
        if part_id in state.blocks:
            texts[part_id] = text_of(_wrapped("Part", block))
        elif part_id in state.connectors:
            link = state.connectors[part_id]
            texts[part_id] = text_of(_wrapped("Part", block, link.start_xyz, link.end_xyz))
        else:
            extras.append(_wrapped("Extra", block))
    rest = ET.Element("FileData", {"version": VERSION})
    rest.append(_machine_element(file.element, scripted_by_us=scripted_by_us))
    rest.extend(extras)
    texts[""] = text_of(rest)
    characters = sum(map(len, texts.values()))
    if characters > MAX_FILE_DATA:
        remarks.add(
            f"the file's data has {characters:,} characters: more than {MAX_FILE_DATA:,} are not "
            "stored with a machine: left out"
        )
        return logged
    return replace(
        logged,
        state=replace(
            state,
            file_data=texts[""],
            blocks={
                block.id: replace(block, file_data=texts.get(block.id, ""))
                for block in state.blocks.values()
            },
            connectors={
                link.id: replace(link, file_data=texts.get(link.id, ""))
                for link in state.connectors.values()
            },
        ),
    )


def part_data(part: Block | Connector) -> PartData | None:
    """The file data of a part; None where it has none.

    Raises:
        MachineFileError: It is not what a machine file says of such a part.
    """
    if not part.file_data:
        return None
    where = f"the file data of block {part.id}"
    try:
        wrapped = _unwrapped(part.file_data, "Part")
        place, block = _placed_block(wrapped)
        ends = tuple(
            _vector(wrapped.get(name, "")) for name in ("begin", "end") if name in wrapped.attrib
        )
    except ValueError as error:
        raise MachineFileError(f"{where}: {error}") from error
    if block.type != part.module.besiege_id:
        raise MachineFileError(f"{where} is of type {block.type}, not {part.module.besiege_id}")
    return PartData(place=place, block=block, ends=ends)


def machine_data(machine: Machine) -> MachineData | None:
    """The file data of a machine beside that of its parts; None where it has none.

    Raises:
        MachineFileError: It is not what a machine file says.
    """
    text = machine.state.file_data
    if not text:
        return None
    try:
        root = _unwrapped(text, "FileData")
        if root.get("version") != VERSION:
            raise ValueError(f"it is not of version {VERSION}")  # noqa: TRY301
        element = root.find("Machine")
        if element is None:
            raise ValueError("it has no Machine")  # noqa: TRY301
        extras = list(map(_placed_block, root.findall("Extra")))
    except ValueError as error:
        raise MachineFileError(f"the file data of the machine: {error}") from error
    return MachineData(
        element=element, extras=tuple((place, block.element) for place, block in extras)
    )


def file_data_lines(machine: Machine) -> tuple[str, ...]:
    """What the machine's file data says beyond the machine, a sentence for each part."""
    lines = list(_lines(machine))
    further = len(lines) - _MAX_LINES
    return tuple(lines) if further <= 0 else (*lines[:_MAX_LINES], f"and {further} more")


def is_scripts(key: str) -> bool:
    """Whether an entry of a machine's data belongs to its Lua script."""
    return key.strip().lower().startswith(_SCRIPT)


def data_entries(machine: Element) -> Iterator[Element]:
    """The entries of a machine's own data."""
    for data in machine.findall("Data"):
        yield from data


def _lines(machine: Machine) -> Iterator[str]:
    try:
        data = machine_data(machine)
    except MachineFileError as error:
        yield str(error)
        data = None
    if data is not None:
        entries = read_entries(data.element, "the machine's Data")
        sentences = [
            entry.told
            for entry in entries
            if not is_scripts(entry.key) and (entry.key != "requiredMods" or entry.value)
        ]
        script = sum(len(entry.text) for entry in entries if entry.key == "lua_data")
        if script:
            sentences.append(f"a Lua script of {script} characters, which is not run")
        if sentences:
            yield f"the machine: {'; '.join(sentences)}"
        for place, element in data.extras:
            yield f"block {place} of the file: type {element.get('id')}, no part of the machine"
    for part in machine.state.parts:
        try:
            own = part_data(part)
        except MachineFileError as error:
            yield str(error)
            continue
        sentences = [] if own is None else list(differences(own.block, part.module))
        if sentences:
            yield f"block {part.id} ({part.module.name}): {'; '.join(sentences)}"


def _machine_element(root: Element, *, scripted_by_us: bool) -> Element:
    """A copy of the file's root without name and script, with the elements each file has."""
    element = copy.deepcopy(root)
    element.attrib.pop("name", None)
    if element.find("Blocks") is None:
        element.append(ET.Element("Blocks"))
    if element.find("Data") is None:
        element.insert(list(element).index(_child(element, "Blocks")), ET.Element("Data"))
    if element.find("Global") is None:
        place = ET.Element("Global")
        ET.SubElement(place, "Position", {"x": "0", "y": "5", "z": "0"})
        ET.SubElement(place, "Rotation", _UNTURNED)
        element.insert(0, place)
    for data in element.findall("Data"):
        data.text = (data.text or "").strip() or None
        for entry in list(data):
            key = entry.get("key", "")
            if scripted_by_us and is_scripts(key):
                data.remove(entry)
            elif key.startswith(STORED_SCRIPT):
                entry.set("key", key.removeprefix(STORED_SCRIPT))
    return element


def _child(element: Element, tag: str) -> Element:
    child = element.find(tag)
    assert child is not None  # noqa: S101  it was put there
    return child


def _wrapped(tag: str, block: FileBlock, *ends: Vector) -> Element:
    wrapped = ET.Element(tag, {"place": str(block.number)})
    for name, point in zip(("begin", "end"), ends, strict=False):
        wrapped.set(name, " ".join(map(repr, point)))
    wrapped.append(block.element)
    return wrapped


def _unwrapped(text: str, tag: str) -> Element:
    root = parsed(text.encode())
    without_blanks(root)
    if root.tag != tag:
        raise ValueError(f"it begins with {shown(root.tag)}, not {tag}")
    return root


def _placed_block(wrapped: Element) -> tuple[int, FileBlock]:
    place = wrapped.get("place", "")
    if len(wrapped) != 1 or not (place.isascii() and place.isdecimal() and len(place) < 7):  # noqa: PLR2004
        raise ValueError("it is not one block with its place in the file")
    return int(place), read_block(wrapped[0], int(place))


def _vector(text: str) -> Vector:
    x, y, z = map(float, text.split())
    return (x, y, z)
