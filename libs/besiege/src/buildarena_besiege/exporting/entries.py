"""Entries of a block in a machine file, before they are written."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from buildarena_besiege.names import key_entries
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_frame, besiege_offset
from buildarena_geometry.blocks import Block, Connector, FaceRef
from buildarena_geometry.modules.module import Module
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Vector
from buildarena_geometry.state import span_in

Value = str | int | float | bool | Vector | tuple[str, ...]
Entry = tuple[str, str, Value]
"""Type, key and value, as in `<Type key="key">value</Type>`."""


def block_entries(block: Block, keys: Mapping[str, Sequence[str]]) -> list[Entry]:
    """Return the entries of a block, in the order of the published files.

    Args:
        keys: Keys of each of its actions.
    """
    module = block.module
    lists = key_lists(module, keys)
    if module.kind == "start":
        return [("Integer", "bmt-version", 1), *lists]
    typed_entries: list[Entry] = [
        (datum.type, datum.key, typed(datum.type, datum.value)) for datum in module.besiege.data
    ]
    before = [entry for entry in typed_entries if entry[1] in _BEFORE_KEYS]
    after = [entry for entry in typed_entries if entry[1] not in _BEFORE_KEYS]
    entries = [*before, *lists, *after]
    if module.spins:
        entries.append(("Boolean", "flipped", block.flipped))
    return entries


def key_lists(module: Module, keys: Mapping[str, Sequence[str]]) -> list[Entry]:
    """Return the lists of the keys of a module's actions, each without duplicates."""
    return [
        ("StringArray", entry, tuple(dict.fromkeys(keys.get(action, ()))))
        for action, entry in key_entries(module).items()
    ]


def connector_entries(machine: Machine, link: Connector) -> list[Entry]:
    """Return the four entries of a brace or winch: its present ends in its own frame."""
    across = span_in(link.world_from_connector, link.start_xyz, link.end_xyz)
    return [
        ("Vector3", "start-position", (0.0, 0.0, 0.0)),
        ("Vector3", "end-position", besiege_offset(across)),
        ("Vector3", "start-rotation", end_rotation(_frame(machine, link.start))),
        ("Vector3", "end-rotation", end_rotation(_frame(machine, link.end))),
    ]


def _frame(machine: Machine, face: FaceRef) -> Pose:
    block, label = face
    return machine.blocks[block].world_from_face(label)


def end_rotation(world_from_face: Pose) -> Vector:
    """Return a face's frame in the game's connectors: ZYZ angles in degrees, 270 on the first."""
    w, x, y, z = besiege_frame(world_from_face.wxyz)
    half_sum, half_difference = math.atan2(z, w), math.atan2(x, y)
    tilt = 2.0 * math.atan2(math.hypot(x, y), math.hypot(z, w))
    first, last = half_sum - half_difference, half_sum + half_difference
    return (math.degrees(first) + 270.0, math.degrees(tilt), math.degrees(last))


_BEFORE_KEYS = frozenset(
    {
        "bmt-version",
        "bmt-speed",
        "bmt-acceleration",
        "bmt-automatic",
        "bmt-toggle-mode",
        "bmt-auto-brake",
    }
)


def typed(kind: str, value: str | float | bool) -> Value:
    """Convert a value of the catalogue to its type in machine files."""
    return float(value) if kind == "Single" else value
