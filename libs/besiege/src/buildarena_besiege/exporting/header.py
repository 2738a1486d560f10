"""The description of a machine in a script's first lines.

A machine file has no names of blocks, no faces and no control sequence. The scripts of this package
begin with a comment that contains all this as JSON. It refers to the blocks by their guids and has
a digest of their positions, so it is valid only while no block was moved.
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
    """Return the comment lines of a machine's script.

    Args:
        records: Blocks of the file.
        presses: Control sequence of the file.
        plain: True for a file without a trial.
        piloted: True if its program acts, with separate keys in the file.
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
    """Return a digest of blocks and their positions, robust to single precision and signs.

    Args:
        parts: Guid, position and rotation of each.
    """
    rows = sorted(
        f"{guid.lower()} {_format_visible(position)} {_format_visible(_signed(rotation))}"
        for guid, position, rotation in parts
    )
    return hashlib.sha256("\n".join(rows).encode("utf-8", "replace")).hexdigest()[:32]


def _signed(rotation: Quaternion) -> tuple[float, ...]:
    """Return the one of a rotation's two quaternions whose first visible component is positive."""
    first = next((number for number in rotation if round(number, _DIGITS)), 1.0)
    return tuple(number if first > 0.0 else -number for number in rotation)


def _format_visible(numbers: tuple[float, ...]) -> str:
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
