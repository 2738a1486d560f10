"""The description of a machine in a script's first lines.

A machine file has no names of blocks, no faces and no control sequence. Our scripts begin with a
comment that holds all this as JSON, tied to the blocks by their guids and by a digest of their
positions, so that it counts only as long as nobody has moved a block.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from typing import Any, Final

from buildarena_besiege.exporting.machine_file import BlockRecord
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.rotations import Quaternion, Vector

MARK: Final = "buildarena machine "
HEADER_VERSION: Final = 1
_DIGITS: Final = 5  # decimals of a coordinate that count


def header_lines(
    machine: Machine,
    records: Sequence[BlockRecord],
    presses: Sequence[KeyPress],
    *,
    plain: bool = False,
    piloted: bool = False,
) -> list[str]:
    """The comment lines of a machine's script.

    Args:
        machine: The machine.
        records: Its blocks in the file.
        presses: The control sequence it is played with.
        plain: Whether it is for no trial.
        piloted: Whether its program acts, which has keys of its own in the file.
    """
    state = machine.state
    parts = {part.id: part for part in state.parts}
    content = {
        "version": HEADER_VERSION,
        "digest": places_digest(
            (record.guid, record.position, record.rotation) for record in records
        ),
        "order": list(parts),
        "parts": {
            record.guid: _part(parts[record.part], record)
            for record in records
            if record.part in parts
        },
        "control_sequence": [[press.time_s, press.key, press.hold_for_s] for press in presses],
        "structures": [
            [structure.letter, structure.source, structure.root]
            for structure in state.structures.values()
        ],
        "structures_made": state.structures_made,
        "next_id": state.next_id,
        **({"plain": True} if plain else {}),
        **({"controller": machine.controller} if machine.controller else {}),
        **({"piloted": True} if piloted else {}),
    }
    return [
        "Plays a trial of BuildArena. The next line tells what the blocks of this file do not.",
        MARK + json.dumps(content, separators=(",", ":"), ensure_ascii=True),
    ]


def places_digest(parts: Iterable[tuple[str, Vector, Quaternion]]) -> str:
    """A digest of blocks and their places, which single precision and a sign do not change.

    Args:
        parts: For each, its guid, its position and its rotation.
    """
    rows = sorted(
        f"{guid.lower()} {_shown(position)} {_shown(_signed(rotation))}"
        for guid, position, rotation in parts
    )
    return hashlib.sha256("\n".join(rows).encode("utf-8", "replace")).hexdigest()[:32]


def _signed(rotation: Quaternion) -> tuple[float, ...]:
    """Of a rotation's two quaternions the one whose first component that shows is positive."""
    first = next((number for number in rotation if round(number, _DIGITS)), 1.0)
    return tuple(number if first > 0.0 else -number for number in rotation)


def _shown(numbers: tuple[float, ...]) -> str:
    return " ".join(f"{round(number, _DIGITS) + 0.0:.{_DIGITS}f}" for number in numbers)


def _part(part: Block | Connector, record: BlockRecord) -> dict[str, Any]:
    common: dict[str, Any] = {"id": part.id}
    if part.structure:
        common["structure"] = part.structure
    if part.note:
        common["note"] = part.note
    if not isinstance(part, Block):
        pose = part.world_from_connector
        return {
            **common,
            "start": list(part.start),
            "end": list(part.end),
            "pose": [*pose.xyz, *pose.wxyz],
            "span": list(part.span),
        }
    if part.mount is not None:
        common["mount"] = list(part.mount)
    if part.lost_mount is not None:
        common["lost_mount"] = list(part.lost_mount)
    written = {key: value for kind, key, value in record.entries if kind == "StringArray"}
    bound = [tuple(dict.fromkeys(keys)) for keys in part.bindings.values()]
    if sorted(bound) != sorted(value for value in written.values() if isinstance(value, tuple)):
        common["bindings"] = {action: list(keys) for action, keys in part.bindings.items()}
    return common
