"""Checks of a package's machines: the history builds the raw one, the tuned one is the same."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final, Protocol

from buildarena_besiege.errors import MachineFileError
from buildarena_besiege.exporting.machine_file import Guids, block_records
from buildarena_besiege.importing.xml_file import FileBlock, FileEntry, FileMachine, parse_file
from buildarena_geometry import module_set
from buildarena_geometry.dialects import dialect
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.machine_files import machine_of
from buildarena_geometry.rotations import Quaternion, Vector, distance
from buildarena_pipeline.challenges.findings import CheckFailed

SAME_PLACE: Final = 1e-4
"""How far two places of one block may differ, units."""
SAME_TURN: Final = 1e-6
"""How far two turns of one block may differ, as 1 - |q·p| of their quaternions."""
SAME_SCALE: Final = 1e-6
_ENDS: Final = frozenset({"start-position", "end-position", "start-rotation", "end-rotation"})
"""A connector's data that say where it is, not how it works."""
_SAME_END: Final = 1e-3
_MODS: Final = "requiredMods"
_TRACKER: Final = "tracker."
_MOST_ACTIONS: Final = 20_000
_STARTING_BLOCK: Final = 0
_SHOWN: Final = 12


class Placed(Protocol):
    """A block as a machine file has it, or would have it."""

    @property
    def position(self) -> Vector:
        """Units, the game's axes."""

    @property
    def rotation(self) -> Quaternion:
        """(w, x, y, z)."""


def read_file(data: bytes, name: str) -> FileMachine:
    """A machine file of the package.

    Raises:
        CheckFailed: It cannot be read.
    """
    try:
        return parse_file(data)
    except MachineFileError as error:
        raise CheckFailed(f"{name}: {error}") from error


def read_actions(data: bytes, name: str) -> list[dict[str, Any]]:
    """The actions of a history.

    Raises:
        CheckFailed: It is no list of actions.
    """
    try:
        content = read_json(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise CheckFailed(f"{name}: not valid JSON: {error}") from error
    if not isinstance(content, list) or not all(_is_action(each) for each in content):
        raise CheckFailed(f'{name}: expected a list of actions {{"op": …, "params": {{…}}}}')
    if len(content) > _MOST_ACTIONS:
        raise CheckFailed(f"{name}: it has {len(content):,} actions; at most {_MOST_ACTIONS:,}")
    return content


def require_history_builds_raw(
    history: Sequence[dict[str, Any]], raw: FileMachine, *, version: str, names: tuple[str, str]
) -> str:
    """Builds the history again, and compares what comes out with the raw machine.

    Args:
        history: The actions.
        raw: The machine that they should build.
        version: The interface that they are of.
        names: The files' names.

    Returns:
        What was seen, a sentence.

    Raises:
        CheckFailed: An action is refused, or a block is another or elsewhere.
    """
    of_history, of_raw = names
    try:
        machine = machine_of(list(history), where=of_history, version=version)
    except DocumentError as error:
        raise CheckFailed(str(error)) from error
    if not machine.blocks:
        raise CheckFailed(f"{of_history}: its actions leave no block")
    built = block_records(machine, Guids(), keys={})
    if len(built) != len(raw.blocks):
        raise CheckFailed(
            f"{of_history} builds {len(built)} blocks, {of_raw} has {len(raw.blocks)}: "
            f"{_difference([each.module.besiege_id for each in built], raw.blocks)}"
        )
    for record, block in zip(built, raw.blocks, strict=True):
        where = f"{of_raw}: {_called(block)}"
        if record.module.besiege_id != block.type:
            raise CheckFailed(
                f"{where} should be the history's {record.part}, a {record.module.name}"
            )
        _require_same_place(record, block, where, f"where {of_history} puts it")
        _require_own_size(block, where)
        ends = {key: value for _, key, value in record.entries if key in _ENDS}
        _require_same_ends(ends, block, where)
    return f"the {len(history)} actions build the {len(built)} blocks of {of_raw}"


def require_full_has_valid(
    full: Sequence[dict[str, Any]], valid: Sequence[dict[str, Any]], *, names: tuple[str, str]
) -> str:
    """The full history contains the valid one, in its order.

    Raises:
        CheckFailed: An action of the valid history is not in the full one, or not there in order.
    """
    of_full, of_valid = names
    rest = iter(enumerate(full, start=1))
    for number, action in enumerate(valid, start=1):
        if not any(_spelled(action) == _spelled(other) for _, other in rest):
            raise CheckFailed(
                f"{of_valid}: action {number}, {_name_of(action)}, is not in {of_full} after those "
                "before it"
            )
    return f"{of_full} has the {len(valid)} actions in their order among {len(full)}"


def require_same_machine(raw: FileMachine, tuned: FileMachine, *, names: tuple[str, str]) -> str:
    """The tuned machine is the raw one but for keys and settings.

    Returns:
        Which blocks have other settings, a sentence.

    Raises:
        CheckFailed: A block was added, removed, moved, turned, resized, exchanged or reconnected.
    """
    of_raw, of_tuned = names
    if len(raw.blocks) != len(tuned.blocks):
        raise CheckFailed(
            f"{of_raw} has {len(raw.blocks)} blocks, {of_tuned} has {len(tuned.blocks)}: "
            f"{_difference([block.type for block in raw.blocks], tuned.blocks)}"
        )
    changed = []
    by_guid = {block.guid.lower(): block for block in tuned.blocks}
    for before in raw.blocks:
        after = by_guid.get(before.guid.lower())
        if after is None:
            raise CheckFailed(
                f"{of_tuned} has no block with the guid {before.guid[:40]}, which {of_raw} has as "
                f"{_called(before)}"
            )
        where = f"{of_tuned}: {_called(after)}"
        if before.type != after.type:
            raise CheckFailed(f"{where} is {_called(before)} in {of_raw}, by its guid")
        _require_same_place(before, after, where, f"in {of_raw}")
        _require_same_scale(before, after, where, of_raw)
        ends = {entry.key: _numbers(entry) for entry in before.entries if entry.key in _ENDS}
        _require_same_ends(ends, after, where)
        if _data(before) != _data(after):
            changed.append(after.number)
    if not changed:
        return f"the {len(tuned.blocks)} blocks are those of {of_raw}"
    listed = ", ".join(map(str, changed[:_SHOWN])) + (", …" if len(changed) > _SHOWN else "")
    return f"the blocks are those of {of_raw}; keys and settings differ in {listed}"


def require_allowed(file: FileMachine, allowed: frozenset[str], name: str) -> str:
    """A machine is made of the season's modules.

    Raises:
        CheckFailed: It is not; the message names the block.
    """
    by_type = _names_by_type()
    for block in file.blocks:
        module = by_type.get(block.type)
        if module is None or module not in allowed:
            raise CheckFailed(f"{name}: {_called(block)} is none of the season's modules")
    if sum(block.type == _STARTING_BLOCK for block in file.blocks) != 1:
        raise CheckFailed(f"{name}: expected one starting block")
    counts = Counter(by_type[block.type] for block in file.blocks)
    return ", ".join(f"{count} {module}" for module, count in counts.items())


def require_no_program(file: FileMachine, mods: Sequence[str], name: str) -> str:
    """A machine needs no mod but the season's, and has no script and no further data.

    Raises:
        CheckFailed: It does; the message names what.
    """
    for entry in file.entries:
        if entry.key == _MODS:
            for mod in filter(None, (entry.text, *entry.items)):
                if mod.partition("~")[0].lower() not in mods:
                    raise CheckFailed(f"{name}: it needs the mod {mod[:80]!r}")
        elif not entry.key.startswith(_TRACKER):
            raise CheckFailed(f"{name}: the machine's data have {entry.told}")
    return "no script, and no mod but the season's"


def cost_of(file: FileMachine, version: str) -> int:
    """What a machine costs: the sum of its modules' prices in an interface of that version."""
    catalogue = dialect(version).catalogue or module_set("all")
    prices = {module.besiege_id: module.cost for module in catalogue.values()}
    return sum(prices.get(block.type, 0) for block in file.blocks)


def starting_guid(file: FileMachine) -> str:
    """The guid of a machine's starting block; "" where it has none."""
    return next((block.guid for block in file.blocks if block.type == _STARTING_BLOCK), "")


def _is_action(value: object) -> bool:
    if not isinstance(value, dict):
        return False
    name, arguments = (
        value.get("op", value.get("name")),
        value.get("params", value.get("arguments")),
    )
    return isinstance(name, str) and isinstance(arguments, dict)


def _name_of(action: dict[str, Any]) -> str:
    return str(action.get("op", action.get("name")))[:60]


def _spelled(action: dict[str, Any]) -> str:
    arguments = action.get("params", action.get("arguments"))
    return json.dumps([_name_of(action), arguments], sort_keys=True)


@cache
def _names_by_type() -> Mapping[int, str]:
    return {module.besiege_id: module.name for module in module_set("all").values()}


def _called(block: FileBlock) -> str:
    name = _names_by_type().get(block.type, f"type {block.type}")
    return f"block {block.number} ({name})"


def _difference(types: Sequence[int], blocks: Sequence[FileBlock]) -> str:
    """Which types one list has more of than another."""
    names, there = _names_by_type(), Counter(block.type for block in blocks)
    missing, further = Counter(types) - there, there - Counter(types)
    said = [f"{n} {names.get(kind, kind)} fewer" for kind, n in missing.items()]
    said += [f"{n} {names.get(kind, kind)} more" for kind, n in further.items()]
    return ", ".join(said)


def _require_same_place(before: Placed, after: FileBlock, where: str, expected: str) -> None:
    apart = distance(before.position, after.position)
    if apart > SAME_PLACE:
        raise CheckFailed(
            f"{where} is at {_shown(after.position)}; {expected} it is at "
            f"{_shown(before.position)}, {apart:.4g} units away"
        )
    cosine = abs(sum(a * b for a, b in zip(before.rotation, after.rotation, strict=True)))
    if 1.0 - min(1.0, cosine) > SAME_TURN:
        degrees = math.degrees(2 * math.acos(min(1.0, cosine)))
        raise CheckFailed(f"{where} is turned by {degrees:.4g}° from how it is {expected}")


def _require_own_size(block: FileBlock, where: str) -> None:
    if any(abs(side - 1.0) > SAME_SCALE for side in block.scale):
        raise CheckFailed(f"{where} has the scale {_shown(block.scale)}; no block may be resized")


def _require_same_scale(before: FileBlock, after: FileBlock, where: str, of_raw: str) -> None:
    if any(abs(a - b) > SAME_SCALE for a, b in zip(before.scale, after.scale, strict=True)):
        raise CheckFailed(
            f"{where} has the scale {_shown(after.scale)}; in {of_raw} {_shown(before.scale)}"
        )


def _require_same_ends(ends: dict[str, Any], block: FileBlock, where: str) -> None:
    """A connector's ends are where they should be."""
    there = {entry.key: _numbers(entry) for entry in block.entries if entry.key in _ENDS}
    for key, expected in ends.items():
        own = there.get(key)
        if own is None:
            raise CheckFailed(f"{where} has no {key}: its connection was removed")
        if not key.endswith("position"):
            continue  # the same frame can be written with other angles
        if len(own) != len(expected) or math.dist(own, expected) > _SAME_END:
            raise CheckFailed(f"{where} has its {key} at {_shown(own)}, not at {_shown(expected)}")
    further = there.keys() - ends.keys()
    if further:
        raise CheckFailed(f"{where} has a {min(further)} that is not in the other file")


def _numbers(entry: FileEntry) -> tuple[float, ...]:
    try:
        return tuple(float(text) for text in entry.components)
    except ValueError:
        return ()


def _data(block: FileBlock) -> list[tuple[str, str, str]]:
    return sorted((entry.kind, entry.key, entry.value) for entry in block.entries)


def _shown(numbers: Sequence[float]) -> str:
    return "(" + ", ".join(f"{number:.6g}" for number in numbers) + ")"
