"""Writes the game's machine files (.bsg)."""

from __future__ import annotations

import html
import math
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.exporting.entries import (
    Entry,
    Value,
    block_entries,
    connector_entries,
    typed,
)
from buildarena_besiege.names import CARGO, CARGO_ID, type_name
from buildarena_besiege.placement import UPRIGHT_CARGO, GlobalPose
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_point, besiege_rotation
from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.modules.module import Module
from buildarena_geometry.rotations import Quaternion, Vector

BSG_VERSION: Final = "1.4"
_INDENT: Final = "    "
_NO_SCALE: Final = (1.0, 1.0, 1.0)
_GUID_ATTEMPTS: Final = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRecord:
    """A block of a machine file, in Besiege's components.

    Attributes:
        part: id of the block or connector in the machine; "Ballast" for the cargo.
        guid: id in the game.
        position: position of its root, units.
        rotation: quaternion (w, x, y, z).
        entries: its data without the script's two.
        scale: along its own axes.
    """

    part: str
    module: Module
    guid: str
    position: Vector
    rotation: Quaternion
    entries: tuple[Entry, ...]
    scale: Vector = _NO_SCALE

    @property
    def reference_key(self) -> str:
        """Name of the block in the script."""
        return f"{type_name(self.module)}_{self.guid[:8]}"

    @property
    def all_entries(self) -> tuple[Entry, ...]:
        """Its data, the script's two entries last."""
        return (
            *self.entries,
            ("String", "bmt-lua_module", "default"),
            ("String", "bmt-lua_ref_key", self.reference_key),
        )

    def lines(self, indent: str) -> Iterator[str]:
        """Return its element in a machine file."""
        inner, innermost = indent + _INDENT, indent + _INDENT * 2
        yield f'{indent}<Block id="{self.module.besiege.id}" guid="{self.guid}">'
        yield f"{inner}<Transform>"
        yield f"{innermost}<Position {_coordinates(self.position)} />"
        yield f"{innermost}<Rotation {_turn(self.rotation)} />"
        yield f"{innermost}<Scale {_coordinates(self.scale)} />"
        yield f"{inner}</Transform>"
        yield f"{inner}<Data>"
        for entry in self.all_entries:
            yield from _entry_lines(entry, innermost)
        yield f"{inner}</Data>"
        yield f"{indent}</Block>"


@dataclass(frozen=True, slots=True, kw_only=True)
class CargoBox:
    """The cargo in a machine file.

    Attributes:
        size: full extents along east, north and up before the machine is turned, units.
        root: centre of its underside, Besiege's components of the machine, units.
    """

    size: Vector
    root: Vector


class Guids:
    """Draws guids whose first eight digits differ, as reference keys hold no more of them."""

    def __init__(self, new_guid: Callable[[], uuid.UUID] = uuid.uuid4) -> None:
        self._new, self._used = new_guid, set[str]()

    def draw(self) -> str:
        """Return the next guid.

        Raises:
            ValueError: The generator repeats itself.
        """
        for _ in range(_GUID_ATTEMPTS):
            guid = str(self._new())
            if guid[:8] not in self._used:
                self._used.add(guid[:8])
                return guid
        raise ValueError(f"the source of guids repeats itself: {guid}")


def block_records(
    machine: Machine,
    guids: Guids,
    *,
    keys: Mapping[str, Mapping[str, Sequence[str]]],
    cargo: CargoBox | None = None,
) -> list[BlockRecord]:
    """Return all blocks of a machine's file: the starting block first, the cargo last.

    Args:
        machine: Machine with at least one block.
        guids: Generator of the blocks' guids.
        keys: Keys of each block's actions, by block id.
        cargo: Cargo, if the file has one.
    """
    records = [
        _block_record(part, guids.draw(), keys.get(part.id, part.bindings))
        if isinstance(part, Block)
        else _connector_record(machine, part, guids.draw())
        for part in parts_in_file_order(machine)
    ]
    if cargo is not None:
        module = next(
            candidate for candidate in machine.catalogue.values() if candidate.besiege.id == CARGO
        )
        records.append(_cargo_record(module, guids.draw(), cargo))
    _require_finite(records)
    return records


def parts_in_file_order(machine: Machine) -> list[Block | Connector]:
    """Return all parts in the order of a machine's file: first block, then order of creation."""
    first = next(iter(machine.blocks), None)
    return sorted(machine.state.parts, key=lambda part: (part.id != first, _number(part)))


def machine_text(name: str, pose: GlobalPose, records: Sequence[BlockRecord], script: str) -> str:
    """Return a machine file's text.

    Args:
        name: Stem of the file name.
        pose: Pose of the machine in the game.
        records: Blocks of the file.
    """
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        "<!--Besiege machine save file.-->",
        f'<Machine version="1" bsgVersion="{BSG_VERSION}" name="{_escaped(name)}">',
        f"{_INDENT}<!--The machine's position and rotation.-->",
        f"{_INDENT}<Global>",
        f"{_INDENT * 2}<Position {_coordinates(pose.position)} />",
        f"{_INDENT * 2}<Rotation {_turn(pose.rotation)} />",
        f"{_INDENT}</Global>",
        f"{_INDENT}<!--The machine's additional data or modded data.-->",
        f"{_INDENT}<Data>",
        *(line for entry in global_entries(script) for line in _entry_lines(entry, _INDENT * 2)),
        f"{_INDENT}</Data>",
        f"{_INDENT}<!--The machine's blocks.-->",
        f"{_INDENT}<Blocks>",
        *(line for record in records for line in record.lines(_INDENT * 2)),
        f"{_INDENT}</Blocks>",
        "</Machine>",
        "",
    ]
    return "\n".join(lines)


def global_entries(script: str) -> tuple[Entry, ...]:
    """Return the machine's own data: the script, its place for the mod, and the mods it needs."""
    return (
        ("StringArray", "lua_files", "LuaRoot/main.lua"),
        ("StringArray", "lua_data", script),
        ("StringArray", "lua_modules_names", "default"),
        ("StringArray", "lua_modules_paths", "LuaRoot/main.lua"),
        ("Boolean", "lua", True),
        ("StringArray", "requiredMods", ()),
    )


def _number(part: Block | Connector) -> tuple[bool, str, int]:
    """Return the sort key of the order of creation, which ids of blocks and connectors share."""
    letter, _, digits = part.id.rpartition("_")
    number = int(digits) if digits.isascii() and digits.isdecimal() and len(digits) < 10 else 0  # noqa: PLR2004
    return (not letter, letter, number)


def _block_record(block: Block, guid: str, keys: Mapping[str, Sequence[str]]) -> BlockRecord:
    return BlockRecord(
        part=block.id,
        module=block.module,
        guid=guid,
        position=besiege_point(block.world_from_block.xyz),
        rotation=besiege_rotation(block),
        entries=tuple(block_entries(block, keys)),
    )


def _connector_record(machine: Machine, link: Connector, guid: str) -> BlockRecord:
    return BlockRecord(
        part=link.id,
        module=link.module,
        guid=guid,
        position=besiege_point(link.start_xyz),
        rotation=besiege_rotation(link),
        entries=tuple(connector_entries(machine, link)),
    )


def _cargo_record(module: Module, guid: str, cargo: CargoBox) -> BlockRecord:
    return BlockRecord(
        part=CARGO_ID,
        module=module,
        guid=guid,
        position=cargo.root,
        rotation=UPRIGHT_CARGO,
        scale=cargo.size,
        entries=tuple(
            (datum.type, datum.key, typed(datum.type, datum.value)) for datum in module.besiege.data
        ),
    )


def _require_finite(records: Sequence[BlockRecord]) -> None:
    for record in records:
        if not all(map(math.isfinite, (*record.position, *record.rotation))):
            raise MachineNotPlayableError(f"Block {record.part} has no place in the game's world.")


def _entry_lines(entry: Entry, indent: str) -> Iterator[str]:
    """Yield the lines of an entry's element."""
    kind, key, value = entry
    opening = f'{indent}<{kind} key="{_escaped(key)}">'
    if kind == "Vector3" and isinstance(value, tuple):
        yield opening
        for axis, number in zip("XYZ", value, strict=True):
            yield f"{indent}{_INDENT}<{axis}>{number!r}</{axis}>"
        yield f"{indent}</{kind}>"
    elif value == ():
        yield f'{indent}<{kind} key="{_escaped(key)}" />'
    else:
        yield f"{opening}{_value(value)}</{kind}>"


def _value(value: Value) -> str:
    if isinstance(value, tuple):
        return "".join(f"<String>{_escaped(str(item))}</String>" for item in value)
    return _escaped(str(value))


def _coordinates(vector: Vector) -> str:
    x, y, z = vector
    return f'x="{x!r}" y="{y!r}" z="{z!r}"'


def _turn(rotation: Quaternion) -> str:
    w, x, y, z = rotation
    return f'x="{x!r}" y="{y!r}" z="{z!r}" w="{w!r}"'


def _escaped(text: str) -> str:
    return html.escape(text)
