"""A machine file that we wrote beside what the game saved of it, entry by entry."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from buildarena_besiege.importing.xml_file import FileBlock, FileEntry, parse_file
from buildarena_geometry import module_set

_SAME: Final = 1e-4
"""What a number may differ by and count as the same."""
_OF_SCRIPTS: Final = ("bmt-lua_module", "bmt-lua_ref_key")
"""Entries of the script, which a game without the mod drops."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeDifference:
    """How blocks of one module type were saved.

    Attributes:
        module: The type's name.
        sent: Blocks in the file that was sent.
        saved: Blocks in the file that the game saved.
        changed: Entries that were sent and came back otherwise or not at all, a sentence each.
        added: Names of entries that the game wrote and we did not.
    """

    module: str
    sent: int
    saved: int
    changed: tuple[str, ...] = ()
    added: tuple[str, ...] = ()


def saved_differences(sent: bytes, saved: bytes) -> tuple[TypeDifference, ...]:
    """How the game saved each module type, in the order of the file that was sent.

    Blocks are paired by their ids in the game; where these were changed, by their order within
    their type.

    Args:
        sent: The machine file that was loaded.
        saved: What the game saved.

    Raises:
        MachineFileError: One of them is no machine file.
    """
    ours, theirs = _by_type(sent), _by_type(saved)
    names = {module.besiege_id: module.name for module in module_set("all").values()}
    kinds = [*ours, *(kind for kind in theirs if kind not in ours)]
    return tuple(
        _difference(names.get(kind, f"type {kind}"), ours.get(kind, []), theirs.get(kind, []))
        for kind in kinds
    )


def _by_type(data: bytes) -> dict[int, list[FileBlock]]:
    blocks: dict[int, list[FileBlock]] = {}
    for block in parse_file(data).blocks:
        blocks.setdefault(block.type, []).append(block)
    return blocks


def _difference(name: str, ours: list[FileBlock], theirs: list[FileBlock]) -> TypeDifference:
    known = {block.guid: block for block in theirs}
    if any(block.guid not in known for block in ours):
        pairs = list(zip(ours, theirs, strict=False))
    else:
        pairs = [(block, known[block.guid]) for block in ours]
    changed: Counter[str] = Counter()
    added: dict[str, None] = {}
    for sent, saved in pairs:
        changed.update(_changed(sent, saved))
        before = {entry.key for entry in sent.entries}
        added |= dict.fromkeys(e.key for e in saved.entries if e.key and e.key not in before)
    return TypeDifference(
        module=name,
        sent=len(ours),
        saved=len(theirs),
        changed=tuple(
            text if count == 1 else f"{text} ({count}x)" for text, count in changed.items()
        ),
        added=tuple(added),
    )


def _changed(sent: FileBlock, saved: FileBlock) -> Iterator[str]:
    if not _near(sent.scale, saved.scale):
        yield f"Scale {_numbers(sent.scale)} became {_numbers(saved.scale)}"
    after = {entry.key: entry for entry in saved.entries}
    for entry in sent.entries:
        if not entry.key or entry.key in _OF_SCRIPTS:
            continue
        now = after.get(entry.key)
        if now is None:
            yield f"{entry.key} is gone"
        elif now.kind != entry.kind:
            yield f"{entry.key} became a {now.kind}, and was a {entry.kind}"
        elif not _same(entry, now):
            yield f"{entry.key} {entry.value or 'empty'} became {now.value or 'empty'}"


def _same(first: FileEntry, second: FileEntry) -> bool:
    texts = [entry.value.replace(",", " ").split() for entry in (first, second)]
    if len(texts[0]) != len(texts[1]):
        return False
    return all(_alike(*pair) for pair in zip(*texts, strict=True))


def _alike(first: str, second: str) -> bool:
    if first.casefold() == second.casefold():
        return True
    try:
        return math.isclose(float(first), float(second), rel_tol=_SAME, abs_tol=_SAME)
    except ValueError:
        return False


def _near(first: tuple[float, ...], second: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= _SAME for a, b in zip(first, second, strict=True))


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)
