"""Reads machine files (.bsg): our own exactly, others' as far as they are understood."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from buildarena_besiege.errors import MachineFileError
from buildarena_besiege.importing.attachment_faces import (
    FaceRef,
    Faces,
    ends_of,
    faces_of,
    mounts_of,
)
from buildarena_besiege.importing.blocks import (
    CARGO_LEFT_OUT,
    Part,
    Remarks,
    differences,
    keys_of,
    part_of,
)
from buildarena_besiege.importing.buildarena_header import (
    HeaderError,
    described_machine,
    header_of,
    is_untouched,
    presses_of,
    sub_document,
)
from buildarena_besiege.importing.xml_file import FileMachine, parse_file, quote
from buildarena_besiege.names import CARGO, MACHINE_SETTINGS, key_entries
from buildarena_geometry import Machine, module_set
from buildarena_geometry.documents.log import LoggedState
from buildarena_geometry.documents.read import read_machine
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.keys import KEYS
from buildarena_geometry.modules.module import Catalogue
from buildarena_geometry.modules.sets import smallest_set
from buildarena_geometry.rotations import subtract
from buildarena_geometry.state import sub_structure_letter

_VERSIONS = ("1.3", "1.4")
_NO_SCRIPT = "the Lua script is not ours: what it does, and the keys it presses, are not read"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedMachine:
    """A machine that was read from a file of the game.

    Attributes:
        name: Name in the file.
        not_understood: Content of the file that was left out or is unknown, a sentence each.
        own_keys: Key lists of the file, by block and action, with keys that machines cannot have.
    """

    machine: Machine
    name: str = ""
    not_understood: tuple[str, ...] = ()
    own_keys: Mapping[str, Mapping[str, tuple[str, ...]]] = field(default_factory=dict)


def read_machine_file(data: bytes, *, catalogue: Catalogue | None = None) -> ImportedMachine:
    """Return the machine of a machine file.

    A file of this package gives the machine it was made from, if its blocks were not moved. In any
    other file the connections are found by positions: a block sits on the face its root touches.
    Further content is listed and left out, as are the cargo and unknown blocks.

    Args:
        catalogue: Modules that it may use. Defaults to every known one.

    Raises:
        MachineFileError: It is not a machine file, or exceeds a limit.
    """
    file, remarks = parse_file(data), Remarks()
    header = _header(file, remarks)
    placed = [part_of(block, catalogue or module_set("all"), remarks) for block in file.blocks]
    parts = _without_cargo([part for part in placed if part is not None], header, remarks)
    catalogue = catalogue or smallest_set({part.module.name for part in parts})
    if not any(part.module.kind == "start" for part in parts):
        raise MachineFileError("the file has no starting block (type 0)")
    logged = None
    piloted = False
    if header is not None:
        logged = _as_described(header, file, parts, catalogue, remarks)
    if header is not None and logged is not None:
        ids = {part.number: header["parts"][part.guid]["id"] for part in parts}
        piloted = header.get("piloted") is True
    else:
        attached = _Placed(parts, remarks)
        logged, ids = _place_machine(attached.document(), catalogue, header, remarks), attached.ids
    _note_differences(file, parts, remarks, piloted=piloted)
    return ImportedMachine(
        machine=Machine.restored(logged),
        name=file.name,
        not_understood=remarks.all(),
        own_keys={} if piloted else _own_keys(file, parts, ids),
    )


def _note_differences(
    file: FileMachine, parts: Sequence[Part], remarks: Remarks, *, piloted: bool
) -> None:
    """Add remarks on differences between the file and the machine."""
    settings = [entry for entry in file.entries if entry.key in MACHINE_SETTINGS and entry.value]
    if settings:
        remarks.add(f"the machine: {'; '.join(entry.as_text for entry in settings)}")
    for part in parts:
        sentences = list(differences(file.blocks[part.number - 1], part.module, piloted=piloted))
        if sentences:
            remarks.add(f"{part.name}: {'; '.join(sentences)}")


def _own_keys(
    file: FileMachine, parts: Sequence[Part], ids: Mapping[int, str]
) -> dict[str, dict[str, tuple[str, ...]]]:
    own: dict[str, dict[str, tuple[str, ...]]] = {}
    for part in parts:
        lists = {entry.key: keys_of(entry) for entry in file.blocks[part.number - 1].entries}
        for action, name in key_entries(part.module).items():
            keys = lists.get(name, ())
            if any(key not in KEYS for key in keys):
                own.setdefault(ids[part.number], {})[action] = keys
    return own


def _without_cargo(
    parts: list[Part], header: dict[str, Any] | None, remarks: Remarks
) -> list[Part]:
    """Return the parts without a task's cargo, which is a ballast too.

    The description of this package lists the blocks of the machine; in other files a cargo is the
    ballast that sits on nothing.
    """
    blocks = [part for part in parts if part.module.kind != "connector"]
    if not any(part.module.besiege.id == CARGO for part in blocks):
        return parts
    described = None if header is None else header.get("parts")
    if isinstance(described, dict):
        loose = {part.number for part in blocks if part.guid not in described}
    else:
        mounts = mounts_of(blocks, faces_of(blocks))
        loose = {other.number for other, mount in zip(blocks, mounts, strict=True) if mount is None}
    for part in blocks:
        if part.module.besiege.id == CARGO and part.number in loose:
            remarks.add(f"{part.name}: {CARGO_LEFT_OUT}")
            parts = [other for other in parts if other.number != part.number]
    return parts


def _header(file: FileMachine, remarks: Remarks) -> dict[str, Any] | None:
    if file.version not in _VERSIONS:
        remarks.add(f"bsgVersion {quote(file.version)} is read as {_VERSIONS[-1]}")
    for tag in file.strays:
        remarks.add(f"the machine's {quote(tag)} is not understood")
    for entry in file.entries:
        if entry.key not in MACHINE_SETTINGS and not _is_scripts(entry.key):
            remarks.add(f"the machine's data {quote(entry.key or entry.text)} is not understood")
    script = next(
        (text_entry.text for text_entry in file.entries if text_entry.key == "lua_data"), ""
    )
    try:
        header = header_of(script)
    except HeaderError as error:
        remarks.add(f"the script's own description is not believed: {error}")
        return None
    if script and header is None:
        remarks.add(_NO_SCRIPT)
    return header


def _is_scripts(key: str) -> bool:
    """Check if an entry of a machine's data belongs to its Lua script."""
    return key.strip().lower().startswith("lua")


def _as_described(
    header: dict[str, Any],
    file: FileMachine,
    parts: Sequence[Part],
    catalogue: Catalogue,
    remarks: Remarks,
) -> LoggedState | None:
    if not is_untouched(header, file):
        remarks.add(
            "blocks were changed after the script was written: names and connections are found by "
            "places"
        )
        return None
    try:
        return described_machine(header, parts, catalogue)
    except HeaderError as error:
        remarks.add(f"the script's own description is not believed: {error}")
        return None


def _place_machine(
    document: dict[str, Any],
    catalogue: Catalogue,
    header: dict[str, Any] | None,
    remarks: Remarks,
) -> LoggedState:
    if header is not None:
        document["control_sequence"] = _sound_presses(header, remarks)
    try:
        return read_machine(document, catalogue=catalogue)
    except DocumentError as error:
        where = str(error).removeprefix("document.blocks: ")
        remarks.add(f"a document of this machine would not be read back: {where}")
    except ValueError as error:
        raise MachineFileError(f"its blocks make no machine: {error}") from error
    try:
        return read_machine(document, catalogue=catalogue, overlaps=True)
    except ValueError as error:
        raise MachineFileError(f"its blocks make no machine: {error}") from error


def _sound_presses(header: dict[str, Any], remarks: Remarks) -> list[dict[str, Any]]:
    try:
        presses = presses_of(header)
        sound = all(
            press["key"] in KEYS
            and 0 <= float(press["time_s"]) < math.inf
            and 0 < float(press["hold_for_s"]) < math.inf
            for press in presses
        )
    except (KeyError, TypeError, ValueError):
        sound = False
    if not sound:
        remarks.add("the script's control sequence is not sound: left out")
        return []
    return presses


class _Placed:
    """A document made of parts and the faces they are found to sit on.

    Attributes:
        ids: the id of each part, by its number in the file.
    """

    def __init__(self, parts: Sequence[Part], remarks: Remarks) -> None:
        starts = [part for part in parts if part.module.kind == "start"]
        mounted = [part for part in parts if part.module.kind not in {"start", "connector"}]
        self._remarks = remarks
        self._blocks: list[Part] = [*starts, *mounted]
        self._links = [part for part in parts if part.module.kind == "connector"]
        self._faces: Faces = faces_of(self._blocks)
        self._mounts = mounts_of(self._blocks, self._faces)
        self._starts = len(starts)
        self._letters = _letters(self._mounts, self._starts)
        self._places = {part.number: i for i, part in enumerate(self._blocks)}
        self.ids: dict[int, str] = {}
        counts: dict[str, int] = {}
        for part in sorted((*self._blocks, *self._links), key=_in_file_order):
            letter = self._letter_of(part)
            counts[letter] = counts.get(letter, 0) + 1
            self.ids[part.number] = f"{letter}_{counts[letter]}" if letter else str(counts[letter])
        self._next = 1 if len(starts) > 1 else len(self.ids) + 1

    def document(self) -> dict[str, Any]:
        """Return the machine document, which is checked by reading it."""
        for part, mount in zip(self._blocks, self._mounts, strict=True):
            if mount is None and part.module.kind != "start":
                self._remarks.add(f"{part.name} sits on no face of another block")
        several = self._starts > 1
        document: dict[str, Any] = {
            "version": 1,
            "blocks": [self._block(i) for i in self._based_first()],
            "joints": [],
            "connectors": [connector for link in self._links for connector in self._link(link)],
            "control_sequence": [],
            "structures": [
                {"letter": self._letters[i], "source": f"part {self._letters[i]}", "root": root}
                for i, root in self._roots()
            ]
            if several
            else [],
            "structures_made": self._starts if several else 0,
            "next_id": self._next,
            "available": {},
            "log": [],
        }
        document["available"] = {
            structure["source"]: sub_document(document, structure["letter"])
            for structure in document["structures"]
        }
        return document

    def _roots(self) -> list[tuple[int, str]]:
        return [(i, self.ids[self._blocks[i].number]) for i in range(self._starts)]

    def _letter_of(self, part: Part) -> str:
        if self._starts < 2:  # noqa: PLR2004  one machine has no sub-structures
            return ""
        if part.module.kind != "connector":
            return self._letters[self._places[part.number]]
        start, _ = ends_of(part, self._blocks, self._faces)
        return self._letters[0 if start is None else start[0]]

    def _based_first(self) -> list[int]:
        """Return the blocks' indices in an order in which each comes after its base."""
        order: list[int] = []
        done: set[int] = set()
        for i in range(len(self._blocks)):
            chain: list[int] = []
            at: int | None = i
            while at is not None and at not in done:
                chain.append(at)
                mount = self._mounts[at]
                at = None if mount is None else mount[0]
            order += reversed(chain)
            done.update(chain)
        return order

    def _block(self, i: int) -> dict[str, Any]:
        part, mount = self._blocks[i], self._mounts[i]
        return {
            **self._common(part),
            "mount": None if mount is None else self._face(mount),
            "flipped": part.flipped,
            "bindings": {action: list(keys) for action, keys in part.bindings.items()},
            "structure": self._letters[i],
        }

    def _link(self, link: Part) -> list[dict[str, Any]]:
        start, end = ends_of(link, self._blocks, self._faces)
        if start is None or end is None or start == end:
            which = "beginning" if start is None else "end"
            self._remarks.add(f"{link.name}: its {which} is on no face of its own: left out")
            return []
        return [
            {
                **self._common(link),
                "start": self._face(start),
                "end": self._face(end),
                "span": list(subtract(link.end, link.start)),
                "structure": self._letters[start[0]],
            }
        ]

    def _common(self, part: Part) -> dict[str, Any]:
        return {
            "id": self.ids[part.number],
            "module": part.module.name,
            "position": list(part.pose.xyz),
            "quaternion": list(part.pose.wxyz),
        }

    def _face(self, ref: FaceRef) -> list[str]:
        return [self.ids[self._blocks[ref[0]].number], ref[1]]


def _in_file_order(part: Part) -> tuple[bool, int]:
    return (part.module.kind != "start", part.number)


def _letters(mounts: Sequence[FaceRef | None], starts: int) -> list[str]:
    """Return the sub-structure of each block by its starting block; "" for a single machine."""
    if starts < 2:  # noqa: PLR2004  one machine has no sub-structures
        return [""] * len(mounts)
    letters = []
    for i in range(len(mounts)):
        at = i
        while (mount := mounts[at]) is not None:
            at = mount[0]
        letters.append(sub_structure_letter(at if at < starts else 0))
    return letters
