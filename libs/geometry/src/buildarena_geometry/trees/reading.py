"""Reads construction trees; whoever wrote a wrong entry is told which, and what it may be.

A tree is a JSON list. Its entries are spelled as in BesiegeField's release, with `id`, `order_id`,
`parent` and `bp_id`, or as in its paper, with `type`, `id`, `parent` and `face_id`; connectors have
two parents, `parent_a` and `parent_b`, and two points.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from buildarena_geometry.actions.lookups import nearest
from buildarena_geometry.errors import TreeError
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.modules.sets import module_set
from buildarena_geometry.reading import shown
from buildarena_geometry.trees.points import point_text, points_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from buildarena_geometry.modules.module import Module

MAX_ENTRIES: Final = 2_000
"""As many as a machine has parts at most."""
MAX_CHARACTERS: Final = 1 << 20
_LARGEST_NUMBER: Final = 1_000_000
_MAX_CHOICES: Final = 12
_GAP: Final = re.compile(r"[\s,]*")
_ROOT_PARENTS: Final = (-1, None)
_OF_ACTIONS: Final = frozenset({"op", "name"})


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spelling:
    """How the fields of an entry are called."""

    type: str
    number: str
    point: str

    @property
    def block(self) -> tuple[str, ...]:
        return (self.type, self.number, "parent", self.point)

    @property
    def connector(self) -> tuple[str, ...]:
        ends = (f"{field}_{end}" for end in "ab" for field in ("parent", self.point))
        return (self.type, self.number, *ends)


_RELEASE: Final = _Spelling(type="id", number="order_id", point="bp_id")
_PAPER: Final = _Spelling(type="type", number="id", point="face_id")


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeEntry:
    """A part of a construction tree.

    Attributes:
        number: What other entries call it.
        module: What it is.
        parents: The entries it is joined to and the faces there, as labels: none for the root, one
            for a block, two for a connector.
        title: What messages call it, such as "entry 4 (id 22, line 6)".
    """

    number: int
    module: Module
    parents: tuple[tuple[int, str], ...]
    title: str


def looks_like_tree(content: object) -> bool:
    """Whether JSON values are meant as a tree: a list whose first entry is no action."""
    if not isinstance(content, list) or not content or not isinstance(content[0], dict):
        return False
    first = content[0].keys()
    return not first & _OF_ACTIONS and bool(first & {"id", "type", "order_id", "parent"})


def tree_in(text: str) -> str:
    """The construction tree in a reply: its last list, in a block of code where there is one.

    Raises:
        TreeError: There is none.
    """
    # Every other part between fences is code.
    blocks = [part.removeprefix("json").strip() for part in text.split("```")[1::2]]
    lists = [block for block in blocks if block.startswith("[")]
    if lists:
        return lists[-1]
    start, end = text.find("["), text.rfind("]")
    if not 0 <= start < end:
        raise TreeError("there is no construction tree, a JSON list of entries, in it")
    return text[start : end + 1]


def read_tree(text: str) -> tuple[TreeEntry, ...]:
    """The entries of a construction tree, each sound by itself and with those before it.

    Whether blocks overlap turns out when they are built.

    Args:
        text: JSON.

    Raises:
        TreeError: It is no such tree; the message names the entry, its line and the valid choices.
    """
    if len(text) > MAX_CHARACTERS:
        raise TreeError(f"expected at most {MAX_CHARACTERS:,} characters, found {len(text):,}")
    try:
        content = read_json(text)
    except (ValueError, RecursionError) as error:
        raise TreeError(f"it is not valid JSON: {error}") from error
    if not isinstance(content, list) or not content:
        raise TreeError(f"expected a list of entries, found {shown(content)}")
    if len(content) > MAX_ENTRIES:
        raise TreeError(f"expected at most {MAX_ENTRIES:,} entries, found {len(content):,}")
    reader = _Reader()
    for place, (value, line) in enumerate(zip(content, _lines(text), strict=True)):
        reader.add(value, place, line)
    return tuple(reader.entries.values())


class _Reader:
    """Entries so far, and the points that are taken.

    Attributes:
        entries: By number.
    """

    def __init__(self) -> None:
        self.entries: dict[int, TreeEntry] = {}
        self._taken: dict[tuple[int, str], int] = {}

    def add(self, value: object, place: int, line: int) -> None:
        """Reads one more entry."""
        if not isinstance(value, dict):
            raise TreeError(
                f"entry {place} (line {line}): expected an object, found {shown(value)}"
            )
        spelling = _PAPER if _PAPER.type in value else _RELEASE
        number = value.get(spelling.number)
        named = number if _is_whole(number) else place
        kind = shown(value.get(spelling.type))
        title = f"entry {named} ({spelling.type} {kind}, line {line})"
        try:
            entry = self._entry(value, spelling, title)
        except TreeError as error:
            raise TreeError(f"{title}: {error}") from None
        self.entries[entry.number] = entry

    def _entry(self, value: Mapping[str, Any], spelling: _Spelling, title: str) -> TreeEntry:
        module = _module(value.get(spelling.type), spelling.type)
        number = _whole(value, spelling.number)
        if number in self.entries:
            raise TreeError(f"{spelling.number} {number} is an earlier entry's as well")
        if not self.entries:
            parents = _no_parents(value, module, spelling)
        elif module.kind == "start":
            raise TreeError("a tree has one starting block, its first entry")
        elif module.kind == "connector":
            _check_fields(value, spelling.connector, f"a {module.name} joins two")
            parents = tuple(self._parent(value, spelling, end) for end in ("_a", "_b"))
        else:
            _check_fields(value, spelling.block, f"a {module.name} sits on one")
            parents = (self._parent(value, spelling, ""),)
            self._take(parents[0], number)
        return TreeEntry(number=number, module=module, parents=parents, title=title)

    def _parent(self, value: Mapping[str, Any], spelling: _Spelling, end: str) -> tuple[int, str]:
        field, place = f"parent{end}", f"{spelling.point}{end}"
        number = _whole(value, field, at_least=-1)
        parent = self.entries.get(number)
        if parent is None:
            blocks = [entry.number for entry in self.entries.values() if points_of(entry.module)]
            raise TreeError(
                f"{field} {number} is not an earlier entry; earlier blocks: {_numbers(blocks)}"
            )
        points = points_of(parent.module)
        if not points:
            raise TreeError(f"nothing can be put on a {parent.module.name} (entry {number})")
        point = _whole(value, place, at_least=-1)
        if not 0 <= point < len(points):
            raise TreeError(
                f"a {parent.module.name} (entry {number}) has no point {point}; its points: "
                f"{listing(self._points(parent, range(len(points))))}"
            )
        return number, points[point].label

    def _take(self, parent: tuple[int, str], number: int) -> None:
        occupant = self._taken.setdefault(parent, number)
        if occupant != number:
            base = self.entries[parent[0]]
            labels = [face.label for face in points_of(base.module)]
            free = [i for i, label in enumerate(labels) if (base.number, label) not in self._taken]
            raise TreeError(
                f"point {labels.index(parent[1])} of entry {base.number} is taken by entry "
                f"{occupant}; its free points: {listing(self._points(base, free))}"
            )

    @staticmethod
    def _points(entry: TreeEntry, numbers: Sequence[int]) -> list[str]:
        return [point_text(entry.module, number).partition(" [")[0] for number in numbers]


def _no_parents(
    value: Mapping[str, Any], module: Module, spelling: _Spelling
) -> tuple[tuple[int, str], ...]:
    """Checks that the first entry is a root."""
    if module.kind != "start":
        start = module_set("all").start
        raise TreeError(f"a tree begins with its {start.name} (type {start.besiege_id})")
    wrong = [name for name in value if name not in spelling.block]
    if wrong:
        raise TreeError(f"there is no field {shown(wrong[0])}; fields: {listing(spelling.block)}")
    for field in ("parent", spelling.point):
        parent = value.get(field)
        if isinstance(parent, bool) or parent not in _ROOT_PARENTS:
            raise TreeError(f"the {module.name} sits on nothing: {field} is -1")
    return ()


def _check_fields(value: Mapping[str, Any], fields: Sequence[str], why: str) -> None:
    wrong = [name for name in value if name not in fields]
    missing = [name for name in fields if name not in value]
    if wrong or missing:
        what = f"there is no field {shown(wrong[0])}" if wrong else f"{missing[0]} is missing"
        raise TreeError(f"{what}: {why}; fields: {listing(fields)}")


def _module(written: object, field: str) -> Module:
    """The module that a type means: a number, digits or a name."""
    known = module_set("all")
    if isinstance(written, str) and not (written.isascii() and written.isdecimal()):
        module = known.named(written)
        if module is not None:
            return module
    elif _is_whole(written) or isinstance(written, str):
        for module in known.values():
            if str(module.besiege_id) == str(written):
                return module
    choices = ", ".join(str(number) for number in sorted(m.besiege_id for m in known.values()))
    if isinstance(written, str):
        choices = nearest(written, list(known))
    raise TreeError(
        f"there is no type {shown(written)}; {field} is a module or its number: {choices}"
    )


def _whole(value: Mapping[str, Any], field: str, *, at_least: int = 0) -> int:
    if field not in value:
        raise TreeError(f"{field} is missing")
    number = value[field]
    if not _is_whole(number) or not at_least <= number <= _LARGEST_NUMBER:
        raise TreeError(
            f"{field}: expected a whole number from {at_least} to {_LARGEST_NUMBER}, "
            f"found {shown(number)}"
        )
    whole: int = number
    return whole


def _is_whole(number: object) -> bool:
    return isinstance(number, int) and not isinstance(number, bool)


def _numbers(numbers: Sequence[int]) -> str:
    """Some numbers, the middle of many left out."""
    shown_first = [str(number) for number in numbers[: _MAX_CHOICES - 1]]
    if len(numbers) > _MAX_CHOICES:
        return f"{listing(shown_first)} … {numbers[-1]}"
    return listing(str(number) for number in numbers)


def _lines(text: str) -> list[int]:
    """The line, from 1, in which each entry of a JSON list begins."""
    decoder = json.JSONDecoder()
    lines: list[int] = []
    line, place, seen = 1, text.index("[") + 1, 0
    while True:
        gap = _GAP.match(text, place)
        place = place if gap is None else gap.end()
        if text[place] == "]":
            return lines
        line += text.count("\n", seen, place)
        seen = place
        lines.append(line)
        _, place = decoder.raw_decode(text, place)
