"""Whether a file of ours says more than its machine: somebody has added to it, or changed it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree as ET

from buildarena_besiege.exporting.machine_file import (
    Guids,
    block_records,
    global_entries,
    machine_text,
)
from buildarena_besiege.importing.xml_file import is_number, without_blanks
from buildarena_besiege.keys import HELD_KEY, bindings_of, channel_keys
from buildarena_besiege.names import key_entries
from buildarena_besiege.placement import AS_BUILT

if TYPE_CHECKING:
    from collections.abc import Mapping
    from xml.etree.ElementTree import Element

    from buildarena_besiege.importing.xml_file import FileMachine
    from buildarena_geometry import Machine

_ALIKE: Final = 1e-4
"""What a number may miss by being written in single precision, of units and of degrees."""


def says_more(
    file: FileMachine, header: Mapping[str, Any], machine: Machine, ids: Mapping[int, str]
) -> bool:
    """Whether a file of ours is another than the one that its machine would be written to.

    Places and turns of blocks are not compared: the description holds only where they are the same.

    Args:
        file: The file.
        header: The description in its script.
        machine: The machine of both.
        ids: The parts of the machine by the numbers of the file's blocks; others are the task's.
    """
    piloted = header.get("piloted") is True
    bindings = channel_keys(machine) if piloted else bindings_of(machine, None)
    records = block_records(machine, Guids(), keys=bindings)
    of_part = {record.part: record for record in records}
    plain = header.get("plain") is True
    order = [ids[block.number] for block in file.blocks if block.number in ids]
    if order != [record.part for record in records] or not _same_rest(file, plain=plain):
        return True
    return any(
        not _same_block(
            block.element,
            "\n".join(replace(of_part[ids[block.number]], guid=block.guid).lines("")),
            plain=plain,
        )
        for block in file.blocks
        if block.number in ids
    )


def take_trials_key_out(file: FileMachine, machine: Machine, ids: Mapping[int, str]) -> None:
    """Leaves the machine's own keys in a file that holds the key of a trial beside them.

    Args:
        file: A file of ours that was made for a trial; its elements are changed.
        machine: The machine, with the keys it was built with.
        ids: As for `says_more`.
    """
    for block in file.blocks:
        part = machine.blocks.get(ids.get(block.number, ""))
        if part is None:
            continue
        actions = {name: action for action, name in key_entries(part.module).items()}
        for entry in block.element.iterfind("Data/*"):
            action = actions.get(entry.get("key", ""))
            own = HELD_KEY in part.bindings.get(action or "", ())
            if action is None or own:
                continue
            for key in [child for child in entry if (child.text or "").strip() == HELD_KEY]:
                entry.remove(key)


def _same_rest(file: FileMachine, *, plain: bool) -> bool:
    """Whether a file has nothing but what we write beside its blocks."""
    ours = _element(machine_text("", AS_BUILT, (), ""))
    theirs = file.element
    if {**theirs.attrib, "name": ""} != ours.attrib or theirs.text:
        return False
    if [part.tag for part in theirs] != [part.tag for part in ours]:
        return False
    entries = [(kind, key) for kind, key, _ in global_entries("")]
    data, place = theirs.find("Data"), theirs.find("Global")
    assert data is not None and place is not None  # noqa: S101, PT018  as in ours
    mods = data.find("*[@key='requiredMods']")
    return (
        [(entry.tag, entry.get("key")) for entry in data] == entries
        and (mods is None or not (mods.text or len(mods)))
        and not any((data.text, data.attrib, *(entry.tail for entry in data)))
        and (not plain or _same(place, ours[0]))
    )


def _same_block(theirs: Element, text: str, *, plain: bool) -> bool:
    ours = _element(text)
    if theirs.attrib.keys() != ours.attrib.keys() or len(theirs) != len(ours):
        return False
    for their_part, our_part in zip(theirs, ours, strict=True):
        if our_part.tag != "Transform":
            if not _same_data(their_part, our_part, held=not plain):
                return False
            continue
        tags = [axis.tag for axis in our_part]
        if their_part.tag != "Transform" or [axis.tag for axis in their_part] != tags:
            return False
        if not _same(their_part[-1], our_part[-1]):
            return False
    return True


def _same_data(theirs: Element, ours: Element, *, held: bool) -> bool:
    same = theirs.tag == ours.tag and not (theirs.attrib or theirs.text)
    return (
        same
        and len(theirs) == len(ours)
        and all(_same(*pair, held=held) for pair in zip(theirs, ours, strict=True))
    )


def _same(theirs: Element, ours: Element, *, held: bool = False) -> bool:
    if theirs.tag != ours.tag or theirs.attrib.keys() != ours.attrib.keys():
        return False
    if not all(_alike(theirs.attrib[name], value) for name, value in ours.items()):
        return False
    if not _alike(theirs.text or "", ours.text or "") or theirs.tail:
        return False
    children = list(theirs)
    further = [child.text for child in children[len(ours) :]]
    if held and theirs.tag == "StringArray" and further == [HELD_KEY]:
        # The key of a trial whose cannons are held stands behind the machine's own.
        children = children[: len(ours)]
    return len(children) == len(ours) and all(map(_same, children, ours))


def _alike(theirs: str, ours: str) -> bool:
    if theirs == ours:
        return True
    if not (is_number(theirs) and is_number(ours)):
        return theirs.lower() == ours.lower() and ours in {"True", "False"}
    return math.isclose(float(theirs), float(ours), rel_tol=_ALIKE, abs_tol=_ALIKE)


def _element(text: str) -> Element:
    element = ET.fromstring(text)  # noqa: S314  our own
    without_blanks(element)
    return element
