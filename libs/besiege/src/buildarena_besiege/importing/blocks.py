"""Conversion of a file's blocks to parts, and the entries that carry further information."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from buildarena_besiege.errors import MachineFileError
from buildarena_besiege.importing.xml_file import (
    FileBlock,
    FileEntry,
    is_number,
    number_of,
    quote,
)
from buildarena_besiege.names import CARGO, SETTINGS, key_entries
from buildarena_geometry.besiege_components import besiege_offset, pose_from_besiege
from buildarena_geometry.keys import KEYS
from buildarena_geometry.modules.module import Catalogue, Module
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import ORIGIN, Vector

_KEY: Final = re.compile(
    r"""
    [A-Z] | Alpha\d | Keypad\d | F([1-9]|1[0-5]) | (Up|Down|Right|Left)Arrow
    | Keypad(Period|Divide|Multiply|Minus|Plus|Enter|Equals)
    | (Right|Left)(Shift|Control|Alt|Meta|Command|Apple|Windows|Paren|Bracket|Curly)
    | Backspace | Delete | Tab | Clear | Return | Pause | Escape | Space | Insert | Home | End
    | Page(Up|Down) | Numlock | CapsLock | ScrollLock | AltGr | Help | Print | SysReq | Break | Menu
    | Exclaim | DoubleQuote | Hash | Dollar | Percent | Ampersand | Quote | Asterisk | Plus | Comma
    | Minus | Period | Slash | Colon | Semicolon | Less | Equals | Greater | Question | At
    | Backslash | Caret | Underscore | BackQuote | Pipe | Tilde | None
    | M[0-6] | Mouse[0-6] | Joystick([1-9]|1[0-6])?Button1?\d
    """,
    re.ASCII | re.VERBOSE,
)


def is_game_key(name: str) -> bool:
    """Check if the game has a key, or a button of mouse or joystick, of this name."""
    return _KEY.fullmatch(name) is not None


CARGO_LEFT_OUT: Final = "a cargo is the task's: left out"
_SCRIPTING: Final = ("bmt-lua_module", "bmt-lua_ref_key")
_ENDS: Final = ("start-position", "end-position")
_END_ROTATIONS: Final = ("start-rotation", "end-rotation")
_SAME: Final = 1e-6  # what a number may miss by being written in single precision
_MAX_REMARKS: Final = 200


class Remarks:
    """Bounded list of what was not understood, in order and without duplicates."""

    def __init__(self) -> None:
        self._found: dict[str, None] = {}
        self._further = 0

    def add(self, text: str) -> None:
        """Add a remark."""
        if text in self._found:
            return
        if len(self._found) >= _MAX_REMARKS:
            self._further += 1
            return
        self._found[text] = None

    def all(self) -> tuple[str, ...]:
        """Return all remarks."""
        more = (f"and {self._further} more",) if self._further else ()
        return (*self._found, *more)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A block of a file that corresponds to a module.

    Attributes:
        number: number in the file, from 1.
        guid: id in the game.
        pose: world_from_block, or world_from_connector.
        flipped: true if its spin is reversed.
        bindings: keys of its actions.
        start: start of a connector in its own frame, units.
        end: end of a connector in its own frame, units.
        end_rotation: frame of a connector's end face as in the file; None without one.
    """

    number: int
    guid: str
    module: Module
    pose: Pose
    flipped: bool = False
    bindings: dict[str, tuple[str, ...]] = field(default_factory=dict)
    start: Vector = ORIGIN
    end: Vector = ORIGIN
    end_rotation: Vector | None = None

    @property
    def name(self) -> str:
        """Name in remarks."""
        return f"block {self.number} ({self.module.name})"


def part_of(block: FileBlock, catalogue: Catalogue, remarks: Remarks) -> Part | None:
    """Return the part for a block of a file; None, with a remark, if it is left out.

    Raises:
        MachineFileError: A number of it is invalid.
    """
    module = next(
        (candidate for candidate in catalogue.values() if candidate.besiege.id == block.type), None
    )
    if module is None:
        remarks.add(f"block {block.number}: no module is of the game's type {block.type}: left out")
        return None
    where = _where(block, module)
    if module.kind == "cargo" or (module.besiege.id == CARGO and _is_scaled(block)):
        remarks.add(f"{where}: {CARGO_LEFT_OUT}")
        return None
    for remark in _entry_remarks(block, module):
        remarks.add(f"{where}: {remark}")
    return _read_part(block, module)


def _read_part(block: FileBlock, module: Module) -> Part:
    """Convert a block of a file to a part.

    Raises:
        MachineFileError: A number of it is invalid.
    """
    where = _where(block, module)
    try:
        pose = pose_from_besiege(module, block.position, block.rotation)
    except ValueError as error:
        raise MachineFileError(f"{where}: {error}") from error
    ends = _ends(block, where) if module.kind == "connector" else {}
    return Part(
        number=block.number,
        guid=block.guid,
        module=module,
        pose=pose,
        flipped=module.spins and _truth(block, "flipped"),
        bindings=dict(_bindings(block, module)),
        start=besiege_offset(ends.get("start-position", ORIGIN)),
        end=besiege_offset(ends.get("end-position", ORIGIN)),
        end_rotation=ends.get("end-rotation"),
    )


def differences(block: FileBlock, module: Module, *, piloted: bool) -> Iterator[str]:
    """Yield the known entries of a block whose values the part does not have.

    Args:
        piloted: True if a program acts by separate keys, which are not differences.
    """
    usual = {datum.key: datum.value for datum in module.besiege.data}
    lists, silent = set(key_entries(module).values()), _known_entries(module)
    if _is_scaled(block):
        yield f"Scale {' '.join(f'{factor:g}' for factor in block.scale)} (simulated as 1 1 1)"
    for entry in block.entries:
        if entry.key in silent or (entry.key == "flipped" and module.spins):
            continue
        if entry.key in lists:
            if not piloted and any(key not in KEYS for key in keys_of(entry)):
                yield entry.as_text
        elif entry.key not in usual:
            if entry.key in SETTINGS:
                yield entry.as_text
        elif not _is(entry.text, usual[entry.key]):
            yield f"{entry.as_text} (simulated as {usual[entry.key]})"


def keys_of(entry: FileEntry) -> tuple[str, ...]:
    """Return the keys in a list of keys."""
    return entry.items or ((entry.text,) if entry.text else ())


def _where(block: FileBlock, module: Module) -> str:
    return f"block {block.number} ({module.name})"


def _is_scaled(block: FileBlock) -> bool:
    return any(abs(factor - 1.0) > _SAME for factor in block.scale)


def _ends(block: FileBlock, where: str) -> dict[str, Vector]:
    ends: dict[str, Vector] = {}
    for entry in block.entries:
        if entry.key in _ENDS or (entry.key == "end-rotation" and len(entry.components) == 3):  # noqa: PLR2004
            if len(entry.components) != 3:  # noqa: PLR2004  x, y and z
                raise MachineFileError(f"{where}: {entry.key} has no X, Y and Z")
            x, y, z = (
                number_of(component, f"{where}: {entry.key}") for component in entry.components
            )
            ends[entry.key] = (x, y, z)
    if "end-position" not in ends:
        raise MachineFileError(f"{where}: it has no end-position")
    return ends


def _bindings(block: FileBlock, module: Module) -> Iterator[tuple[str, tuple[str, ...]]]:
    entries = {entry.key: entry for entry in block.entries}
    of_action = key_entries(module)
    for action in module.actions:
        entry = entries.get(of_action.get(action, ""))
        keys = () if entry is None else keys_of(entry)
        yield action, tuple(dict.fromkeys(key for key in keys if key in KEYS))


def _truth(block: FileBlock, key: str) -> bool:
    return any(entry.key == key and entry.text.lower() == "true" for entry in block.entries)


def _entry_remarks(block: FileBlock, module: Module) -> Iterator[str]:
    """Yield remarks on the entries that are unknown or have invalid values."""
    usual = {datum.key: datum.value for datum in module.besiege.data}
    lists, understood = set(key_entries(module).values()), _known_entries(module)
    names: set[str] = set()
    yield from (f"{quote(tag)} is not understood" for tag in block.strays)
    for entry in block.entries:
        if entry.key in names:
            yield f"{quote(entry.key)} stands there twice"
        names.add(entry.key)
        if entry.key in understood:
            continue
        if entry.key in lists:
            wrong = [key for key in keys_of(entry) if not is_game_key(key)]
            yield from (f"{quote(entry.key)}: there is no key {quote(key)}" for key in wrong)
        elif entry.key not in SETTINGS and entry.key not in usual:
            yield f"{quote(entry.key or entry.text)} is not understood"
        elif not _is_of_kind(entry):
            yield f"{quote(entry.key)} is {quote(entry.value)}, which is no {quote(entry.kind)}"


def _known_entries(module: Module) -> frozenset[str]:
    """Return the entries that are read whatever their value, or do not affect the machine."""
    if module.kind == "connector":
        return frozenset((*_SCRIPTING, *_ENDS, *_END_ROTATIONS))
    if module.kind == "start":
        return frozenset((*_SCRIPTING, "bmt-version"))
    return frozenset(_SCRIPTING)


def _is_of_kind(entry: FileEntry) -> bool:
    """Check if a setting's text is a value of its type."""
    if entry.kind == "Boolean":
        return entry.text.lower() in {"true", "false"}
    if entry.kind in {"Integer", "Single"}:
        return is_number(entry.text)
    return True


def _is(text: str, value: str | float | bool) -> bool:
    if isinstance(value, bool):
        return text.lower() == str(value).lower()
    if isinstance(value, str):
        return text == value
    try:
        return math.isclose(float(text), value, rel_tol=_SAME, abs_tol=_SAME)
    except ValueError:
        return False
