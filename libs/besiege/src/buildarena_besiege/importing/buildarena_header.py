"""The description of a machine in our own scripts, read back and checked.

It is used only if all of it fits the blocks of the file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from buildarena_besiege.exporting.header import HEADER_VERSION, MARK, places_digest
from buildarena_besiege.importing.blocks import Part
from buildarena_besiege.importing.xml_file import FileMachine
from buildarena_besiege.keys import FIRING_KEY
from buildarena_geometry.blocks import Connector
from buildarena_geometry.documents.log import LoggedState
from buildarena_geometry.documents.read import read_machine
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.modules.module import Catalogue

_SAME_PLACE: Final = 1e-3  # units


class HeaderError(ValueError):
    """A script's own description does not fit its file; the message names the place."""


def header_of(script: str) -> dict[str, Any] | None:
    """Return the description at the beginning of this package's scripts; None in other scripts.

    Raises:
        HeaderError: It is damaged.
    """
    mark = f"-- {MARK}"
    for line in script.splitlines()[:10]:
        if line.startswith(mark):
            try:
                content = read_json(line[len(mark) :])
            except ValueError as error:
                raise HeaderError("it is not valid JSON") from error
            if not isinstance(content, dict) or content.get("version") != HEADER_VERSION:
                raise HeaderError(f"it is not of version {HEADER_VERSION}")
            return content
    return None


def is_untouched(header: dict[str, Any], file: FileMachine) -> bool:
    """Check if the blocks are at the same positions as when the script was written."""
    places = ((block.guid, block.position, block.rotation) for block in file.blocks)
    return bool(header.get("digest") == places_digest(places))


def described_machine(
    header: dict[str, Any], parts: Sequence[Part], catalogue: Catalogue
) -> LoggedState:
    """Return the machine that a file's blocks and its script's description define together.

    Args:
        parts: All blocks and connectors of the file that correspond to modules.

    Raises:
        HeaderError: They do not fit, or the machine is invalid.
    """
    try:
        described = header["parts"]
        by_id = {described[part.guid]["id"]: (part, described[part.guid]) for part in parts}
        order = header["order"]
        if (
            len(by_id) != len(parts)
            or sorted(order) != sorted(by_id)
            or len(described) != len(parts)
        ):
            raise HeaderError("it describes other blocks than the file's")
        plain = header.get("plain") is True
        piloted = header.get("piloted") is True
        entries = [_entry(*by_id[block_id], plain=plain, piloted=piloted) for block_id in order]
        document = {
            "version": 1,
            "blocks": [entry for entry in entries if "span" not in entry],
            "joints": [],
            "connectors": [entry for entry in entries if "span" in entry],
            "control_sequence": presses_of(header),
            **({"controller": header["controller"]} if "controller" in header else {}),
            "structures": [
                {"letter": letter, "source": source, "root": root}
                for letter, source, root in header["structures"]
            ],
            "structures_made": header["structures_made"],
            "next_id": header["next_id"],
            "available": {},
            "log": [],
        }
        document["available"] = _sources(document)
        logged = read_machine(document, catalogue=catalogue)
    except DocumentError as error:
        raise HeaderError(str(error)) from error
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        if isinstance(error, HeaderError):
            raise
        raise HeaderError(f"{type(error).__name__}: {error}") from error
    for link in logged.state.connectors.values():
        _check_ends(link, by_id[link.id][0])
    return logged


def _check_ends(link: Connector, part: Part) -> None:
    """Refuse a description whose connectors join other faces than the file's."""
    ends = (part.pose.point(part.start), part.pose.point(part.end))
    described = (link.start_xyz, link.end_xyz)
    if any(
        math.dist(end, described_end) > _SAME_PLACE
        for end, described_end in zip(ends, described, strict=True)
    ):
        raise HeaderError(f"{link.module.name} {link.id} joins other faces in the file")


def presses_of(header: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the control sequence in a machine document's format; it is checked when read."""
    return [
        {"time_s": time_s, "key": key, "hold_for_s": hold_for_s}
        for time_s, key, hold_for_s in header["control_sequence"]
    ]


def _entry(part: Part, described: dict[str, Any], *, plain: bool, piloted: bool) -> dict[str, Any]:
    common: dict[str, Any] = {
        "id": described["id"],
        "module": part.module.name,
        "position": list(part.pose.xyz),
        "quaternion": list(part.pose.wxyz),
        "structure": described.get("structure", ""),
        "note": described.get("note", ""),
    }
    if part.module.kind == "connector":
        pose = described["pose"]
        return {
            **common,
            "position": pose[:3],
            "quaternion": pose[3:],
            "start": described["start"],
            "end": described["end"],
            "span": described["span"],
        }
    bindings = described.get("bindings", {})
    if not piloted:
        bindings = _bindings(part, {} if plain else bindings)
    return {
        **common,
        "mount": described.get("mount"),
        "lost_mount": described.get("lost_mount"),
        "flipped": part.flipped,
        "bindings": bindings,
    }


def _bindings(part: Part, own: dict[str, Any]) -> dict[str, list[str]]:
    """Return the keys of a block's actions: the file's, without `FIRING_KEY`."""
    bindings: dict[str, list[str]] = {}
    for action, keys in part.bindings.items():
        described = list(own.get(action, keys))
        held = tuple(dict.fromkeys((*described, FIRING_KEY)))
        bindings[action] = described if keys == held else list(keys)
    return bindings


def _sources(document: dict[str, Any]) -> dict[str, Any]:
    """Return an assembly's machines, each as its sub-structure in the assembly."""
    return {
        structure["source"]: sub_document(document, structure["letter"])
        for structure in reversed(document["structures"])
    }


def sub_document(document: dict[str, Any], letter: str) -> dict[str, Any]:
    """Return a sub-structure as a separate machine: its blocks with their original ids."""
    prefix = f"{letter}_"

    def inside(entry: dict[str, Any]) -> bool:
        faces = [entry[name] for name in ("mount", "start", "end") if entry.get(name)]
        return entry["id"].startswith(prefix) and all(face[0].startswith(prefix) for face in faces)

    def renamed(entry: dict[str, Any]) -> dict[str, Any]:
        faces = {
            name: [entry[name][0].removeprefix(prefix), entry[name][1]]
            for name in ("mount", "lost_mount", "start", "end")
            if entry.get(name)
        }
        return {**entry, **faces, "id": entry["id"].removeprefix(prefix), "structure": ""}

    blocks = [renamed(entry) for entry in document["blocks"] if inside(entry)]
    connectors = [renamed(entry) for entry in document["connectors"] if inside(entry)]
    numbers = [int(entry["id"]) for entry in (*blocks, *connectors) if entry["id"].isdecimal()]
    return {
        **document,
        "blocks": blocks,
        "connectors": connectors,
        "control_sequence": [],
        "structures": [],
        "structures_made": 0,
        "next_id": max(numbers, default=0) + 1,
        "available": {},
    }
