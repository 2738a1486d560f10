"""Content of a machine file's XML as plain values, with limits on everything.

Machine files are untrusted: document types, entities and external references are refused, and
size, depth, numbers of blocks and entries, and all numbers have bounds.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

import defusedxml.ElementTree as SafeTree
from defusedxml import DefusedXmlException

from buildarena_besiege.errors import MachineFileError
from buildarena_geometry.actions.parameters import LARGEST_NUMBER
from buildarena_geometry.rotations import (
    NO_ROTATION,
    ORIGIN,
    SHORTEST_QUATERNION,
    Quaternion,
    Vector,
)
from buildarena_simulation.constants import MAX_PARTS

MAX_BYTES: Final = 8 * 1024 * 1024
"""Maximum size of a file; one of 2,000 blocks has 2 MiB."""

MAX_DEPTH: Final = 12
"""Maximum nesting depth; a connector's coordinates have depth six."""

MAX_ENTRIES: Final = 200
"""Most entries of one block, or of the machine itself."""

_KNOWN: Final = frozenset({"Global", "Data", "Blocks"})
_OF_BLOCKS: Final = frozenset({"Transform", "Data"})
_LARGEST_BLOCK_TYPE: Final = 1_000_000
_NUMBER: Final = re.compile(
    r"[+-]?(\d{1,400}(\.\d{0,400})?|\.\d{1,400})([eE][+-]?\d{1,4})?", re.ASCII
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FileEntry:
    """An entry of a block's or a machine's data.

    Attributes:
        kind: type, such as "Boolean".
        key: its name.
        text: its text, without blanks around it.
        items: the texts of its `String` elements.
        components: the texts of its X, Y and Z elements; empty if it has none.
        inner: all texts of its elements.
    """

    kind: str
    key: str
    text: str
    items: tuple[str, ...] = ()
    components: tuple[str, ...] = ()
    inner: tuple[str, ...] = ()

    @property
    def value(self) -> str:
        """Its value as one text."""
        return self.text or ", ".join(self.items) or " ".join(self.inner)

    @property
    def as_text(self) -> str:
        """Its value for messages."""
        value = quote(self.value)[1:-1] if self.value else "empty"
        return f"{quote(self.key)[1:-1]} {value}" if self.key else f"the text {quote(self.text)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileBlock:
    """A block of a file; Besiege's components.

    Attributes:
        number: number in the file, from 1.
        type: number of its type in the game.
        guid: id in the game; "" without one.
        position: units.
        rotation: (w, x, y, z).
        scale: along its own axes.
        entries: its data.
        strays: tags besides those of every block.
    """

    number: int
    type: int
    guid: str
    position: Vector
    rotation: Quaternion
    scale: Vector
    entries: tuple[FileEntry, ...] = ()
    strays: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FileMachine:
    """Content of a machine file.

    Attributes:
        name: name in the file.
        version: version of the format.
        rotation: (w, x, y, z) of the whole machine in the world, Besiege's components.
        entries: the machine's own data.
        blocks: in the file's order.
        strays: tags besides those of every machine file.
    """

    name: str
    version: str
    rotation: Quaternion
    entries: tuple[FileEntry, ...]
    blocks: tuple[FileBlock, ...]
    strays: tuple[str, ...] = ()


def parse_file(data: bytes) -> FileMachine:
    """Parse a machine file.

    Raises:
        MachineFileError: It is not a machine file, or exceeds a limit.
    """
    root = _parsed(data)
    if root.tag != "Machine":
        raise MachineFileError(f"the file's root is {quote(root.tag)}, not Machine")
    blocks = [block for room in root.findall("Blocks") for block in room]
    if not blocks:
        raise MachineFileError("the file has no blocks")
    if len(blocks) > MAX_PARTS:
        raise MachineFileError(f"the file has {len(blocks)} blocks; at most {MAX_PARTS} are read")
    placed = root.find("Global")
    return FileMachine(
        name=root.get("name", "")[:200],
        version=root.get("bsgVersion", ""),
        rotation=NO_ROTATION if placed is None else _rotation(placed, "Global"),
        entries=_read_entries(root, "the machine's Data"),
        blocks=tuple(_read_block(block, number) for number, block in enumerate(blocks, start=1)),
        strays=tuple(_strays(root)),
    )


def number_of(text: str, where: str) -> float:
    """Parse a finite number within the world's bounds.

    Raises:
        MachineFileError: It is not one.
    """
    text = text.strip()
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not abs(value) <= 2 * LARGEST_NUMBER:
        raise MachineFileError(
            f"{where}: {quote(text)} is not a number within ±{2 * LARGEST_NUMBER:.0f}"
        )
    return value


def is_number(text: str) -> bool:
    """Check if a text is a number, including "Infinity" and "NaN" as the game writes them."""
    return _NUMBER.fullmatch(text) is not None or text in {"Infinity", "-Infinity", "NaN"}


def quote(text: object) -> str:
    """Return any text as a short literal."""
    literal = ascii(str(text)[:60])
    return literal if len(str(text)) <= 60 else f"{literal[:-1]}…'"  # noqa: PLR2004


def _parsed(data: bytes) -> Element:
    """Parse untrusted XML and return its root.

    Raises:
        MachineFileError: It is not valid XML, or exceeds a limit.
    """
    if len(data) > MAX_BYTES:
        raise MachineFileError(f"the file has {len(data):,} bytes; at most {MAX_BYTES:,} are read")
    try:
        depth = 0
        root: Element | None = None
        events = SafeTree.iterparse(
            io.BytesIO(data), ("start", "end"), forbid_dtd=True, forbid_entities=True
        )
        for event, element in events:
            depth += 1 if event == "start" else -1
            root = element if root is None else root
            if depth > MAX_DEPTH:
                raise MachineFileError(f"the file nests more than {MAX_DEPTH} levels deep")
    except DefusedXmlException as error:
        raise MachineFileError(
            "the file has a document type or entities, which are not read"
        ) from error
    except (SafeTree.ParseError, ValueError, LookupError) as error:
        if isinstance(error, MachineFileError):
            raise
        raise MachineFileError(f"not valid XML: {error}") from error
    if root is None:
        raise MachineFileError("not valid XML: the file is empty")
    return root


def _read_block(element: Element, number: int) -> FileBlock:
    """Parse a block's values.

    Args:
        number: Number of the block in its file, from 1.

    Raises:
        MachineFileError: It has no type or position, a value is invalid, or there are too many.
    """
    where = f"block {number}"
    if element.tag != "Block":
        raise MachineFileError(f"{where}: {quote(element.tag)} is not a Block")
    written = element.get("id", "")
    if not re.fullmatch(r"\d{1,7}", written, re.ASCII) or int(written) > _LARGEST_BLOCK_TYPE:
        raise MachineFileError(f"{where}: its id {quote(written)} is not the number of a type")
    place = element.find("Transform")
    if place is None or place.find("Position") is None:
        raise MachineFileError(f"{where}: it has no Transform with a Position")
    return FileBlock(
        number=number,
        type=int(written),
        guid=element.get("guid", ""),
        position=_vector(place, "Position", where, ORIGIN),
        rotation=_rotation(place, where),
        scale=_vector(place, "Scale", where, (1.0, 1.0, 1.0)),
        entries=_read_entries(element, where),
        strays=tuple(str(part.tag) for part in element if part.tag not in _OF_BLOCKS),
    )


def _vector(place: Element, tag: str, where: str, default: Vector) -> Vector:
    vector = place.find(tag)
    if vector is None:
        return default
    x, y, z = (number_of(vector.get(axis, ""), f"{where}: {tag} {axis}") for axis in "xyz")
    return (x, y, z)


def _rotation(place: Element, where: str) -> Quaternion:
    rotation = place.find("Rotation")
    if rotation is None:
        return NO_ROTATION
    w, x, y, z = (number_of(rotation.get(axis, ""), f"{where}: Rotation {axis}") for axis in "wxyz")
    length = math.hypot(w, x, y, z)
    if length < SHORTEST_QUATERNION:
        raise MachineFileError(f"{where}: its Rotation has no length")
    return (w / length, x / length, y / length, z / length)


def _read_entries(holder: Element, where: str) -> tuple[FileEntry, ...]:
    """Parse the entries of a block's or a machine's data, and the texts between them.

    Raises:
        MachineFileError: There are too many.
    """
    rooms = holder.findall("Data")
    count = sum(len(data) for data in rooms)
    if count > MAX_ENTRIES:
        raise MachineFileError(f"{where}: {count} entries; at most {MAX_ENTRIES} are read")
    entries = [_entry(element) for data in rooms for element in data]
    strays = [text for data in rooms for text in (data.text, *(entry.tail for entry in data))]
    # The published library writes its own "None" there by accident.
    entries += [
        FileEntry(kind="text", key="", text=stray.strip())
        for stray in strays
        if stray is not None and stray.strip() not in {"", "None"}
    ]
    return tuple(entries)


def _strays(root: Element) -> Iterator[str]:
    """Yield content besides or between the elements of every machine file."""
    yield from (str(part.tag) for part in root if part.tag not in _KNOWN)
    for part in (root, *root.iter("Blocks")):
        texts = ((text or "").strip() for text in (part.text, *(inner.tail for inner in part)))
        yield from filter(None, texts)


def _entry(element: Element) -> FileEntry:
    if len(element) > MAX_ENTRIES:
        raise MachineFileError(f"entry {quote(element.get('key'))}: more than {MAX_ENTRIES} items")
    by_axis = {str(child.tag): (child.text or "").strip() for child in element}
    vector = tuple(by_axis[axis] for axis in "XYZ") if {"X", "Y", "Z"} <= by_axis.keys() else ()
    return FileEntry(
        kind=str(element.tag),
        key=element.get("key", ""),
        text=(element.text or "").strip(),
        items=tuple(_items(element)),
        components=vector,
        inner=tuple(text.strip() for text in element.itertext() if text.strip()),
    )


def _items(element: Element) -> Iterator[str]:
    for child in element:
        if child.tag == "String":
            yield (child.text or "").strip()
