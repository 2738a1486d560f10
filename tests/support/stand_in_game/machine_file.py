"""Reads machine files (.bsg) as the game would: what stands there, nothing made of it yet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]  # x, y, z, w: the file's order
Entry = bool | int | float | str | Vector | tuple[str, ...]

BALLAST = 35
CONNECTORS = (7, 45)


class GameFileError(Exception):
    """A file the game cannot read; the message says what is wrong and where."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileBlock:
    """One block of a machine file, in the game's components (x east, y up, z north).

    Attributes:
        type_id: the number of its type.
        guid: its own name.
        position: (3,) its root, machine frame, units.
        rotation: (4,) x, y, z, w, machine_from_block.
        scale: (3,) along its own axes.
        data: its entries by key; a list of keys is a tuple of texts.
    """

    type_id: int
    guid: str
    position: Vector
    rotation: Rotation
    scale: Vector
    data: Mapping[str, Entry]

    @property
    def ref_key(self) -> str:
        """What scripts call it by; "" if it has no such name."""
        return str(self.data.get("bmt-lua_ref_key", ""))

    @property
    def flipped(self) -> bool:
        """Whether its spin is reversed."""
        return self.data.get("flipped") is True

    def keys(self, entry: str) -> tuple[str, ...]:
        """The keys bound under an entry, such as "bmt-forward"."""
        found = self.data.get(entry, ())
        if isinstance(found, str):
            return (found,) if found else ()
        return tuple(str(key) for key in found) if isinstance(found, tuple) else ()

    def vector(self, entry: str) -> Vector | None:
        """A vector entry, if it is there."""
        found = self.data.get(entry)
        if not isinstance(found, tuple) or len(found) != 3:
            return None
        x, y, z = (float(part) for part in found)
        return (x, y, z)


@dataclass(frozen=True, slots=True, kw_only=True)
class FileMachine:
    """What a machine file holds.

    Attributes:
        name: the name in the file.
        position: (3,) of the machine frame, world, units.
        rotation: (4,) x, y, z, w, world_from_machine.
        data: the machine's own entries.
        blocks: in the order of the file.
    """

    name: str
    position: Vector
    rotation: Rotation
    data: Mapping[str, Entry]
    blocks: tuple[FileBlock, ...]

    @property
    def script(self) -> str | None:
        """The Lua script, if the machine has one that is switched on."""
        text = self.data.get("lua_data")
        return text if self.data.get("lua") is True and isinstance(text, str) else None


def read_machine_file(path: Path) -> FileMachine:
    """The machine in a file.

    Raises:
        GameFileError: the file is not a machine.
        OSError: it cannot be read.
    """
    root = parsed(path.read_bytes(), "Machine")
    globe, blocks = child(root, "Global"), child(root, "Blocks")
    machine = FileMachine(
        name=root.get("name", ""),
        position=vector_of(child(globe, "Position")),
        rotation=rotation_of(child(globe, "Rotation")),
        data=_entries(child(root, "Data")),
        blocks=tuple(_block(element) for element in blocks.iterfind("Block")),
    )
    if not any(block.type_id == 0 for block in machine.blocks):
        raise GameFileError("Blocks: there is no starting block (id 0)")
    return machine


def parsed(data: bytes, name: str) -> Element:
    """The root element of an XML file.

    Raises:
        GameFileError: it is no XML, or its root has another name.
    """
    try:
        root: Element = fromstring(data)
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise GameFileError(f"not XML the game reads: {error}") from None
    if root.tag != name:
        raise GameFileError(f"expected a {name} at the root, found {root.tag}")
    return root


def child(element: Element, name: str) -> Element:
    """The one child of a name.

    Raises:
        GameFileError: there is none.
    """
    found = element.find(name)
    if found is None:
        raise GameFileError(f"{element.tag} has no {name}")
    return found


def vector_of(element: Element) -> Vector:
    """The attributes x, y and z."""
    x, y, z = (number_of(element.get(axis), element.tag, axis) for axis in "xyz")
    return (x, y, z)


def rotation_of(element: Element) -> Rotation:
    """The attributes x, y, z and w, of length 1."""
    x, y, z, w = (number_of(element.get(axis), element.tag, axis) for axis in "xyzw")
    length = math.hypot(x, y, z, w)
    if length < 1e-6:
        raise GameFileError("Rotation: a quaternion of length 0")
    return (x / length, y / length, z / length, w / length)


def number_of(text: str | None, tag: str, what: str) -> float:
    """A finite number.

    Raises:
        GameFileError: it is none.
    """
    try:
        number = float(text if text is not None else "")
    except ValueError:
        raise GameFileError(f"{tag}: {what} is no number: {text!r}") from None
    if not math.isfinite(number):
        raise GameFileError(f"{tag}: {what} is not finite: {text!r}")
    return number


def _block(element: Element) -> FileBlock:
    type_id = element.get("id", "")
    if not type_id.isdecimal():
        raise GameFileError(f"Block: id is no type's number: {type_id!r}")
    transform = child(element, "Transform")
    return FileBlock(
        type_id=int(type_id),
        guid=element.get("guid", ""),
        position=vector_of(child(transform, "Position")),
        rotation=rotation_of(child(transform, "Rotation")),
        scale=vector_of(child(transform, "Scale")),
        data=_entries(child(element, "Data")),
    )


def _entries(element: Element) -> dict[str, Entry]:
    return {entry.get("key", ""): _entry(entry) for entry in element}


def _entry(entry: Element) -> Entry:
    text = entry.text or ""
    if entry.tag == "StringArray":
        # Lists of keys have children; everything else stands directly in the element.
        texts = tuple(item.text or "" for item in entry.iterfind("String"))
        return texts if texts or not text.strip() else text
    if entry.tag == "Vector3":
        x, y, z = (number_of(entry.findtext(axis), "Vector3", axis) for axis in "XYZ")
        return (x, y, z)
    if entry.tag == "Boolean":
        if text.strip() not in ("True", "False"):
            raise GameFileError(f"Boolean {entry.get('key')}: not True or False: {text!r}")
        return text.strip() == "True"
    if entry.tag == "Integer":
        return int(number_of(text, "Integer", str(entry.get("key"))))
    if entry.tag == "Single":
        return number_of(text, "Single", str(entry.get("key")))
    return text
