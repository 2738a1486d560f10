"""Lines that this package's scripts print, parsed one by one.

    ba,<run>,b,<version>,<presses>,<digest>,<sum>
    ba,<run>,w,<gravity>,<entities>,<width>,<height>{,<ground>},<sum>
    ba,<run>,s,<update>,<part>,<parts>{,<number>,<state>,<x>,<y>,<z>},<sum>
    ba,<run>,p,<update>,<part>,<parts>{,<figure>},<sum>
    ba,<run>,f,<update>,<sum>
    ba,<run>,e,<update>,<sum>

Lines of kind p are of a program: its senses, then the level of each action, with six decimals; f
reports its failure. A number counts the reported blocks from 1, the cargo last. A state is the
cargo's mass, whether a cannon burns (0 or 1), "x" once the game destroyed the block, or "-".
Coordinates are Besiege's: x east, y up, z north. A ground is a height, "b" where a block is in the
way, or "-" for none.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

from buildarena_besiege.checksums import checksum
from buildarena_geometry.rotations import Vector

LONGEST_LINE: Final = 2000
"""Characters of a line; one with eight blocks far away from the origin has fewer than 500."""

_NUMBER = r"(?:0|[1-9][0-9]{0,9})"
_DECIMAL = r"(?:-?[0-9]{1,7}\.[0-9]{4}|nan)"
_STATE = rf"(?:-|[01x]|{_DECIMAL})"
_ENTRY = rf",{_NUMBER},{_STATE},{_DECIMAL},{_DECIMAL},{_DECIMAL}"
_FIELDS_OF_ENTRY: Final = 5
_BEGIN: Final = re.compile(rf",b,({_NUMBER}),({_NUMBER}),({_NUMBER})", re.ASCII)
_SAMPLE: Final = re.compile(rf",s,({_NUMBER}),({_NUMBER}),({_NUMBER})((?:{_ENTRY})*)", re.ASCII)
_WORLD: Final = re.compile(
    rf",w,({_DECIMAL}),({_NUMBER}|-),({_NUMBER}),({_NUMBER})((?:,(?:-|b|{_DECIMAL}))*)", re.ASCII
)
_FIGURES: Final = re.compile(
    rf",p,({_NUMBER}),({_NUMBER}),({_NUMBER})((?:,-?[0-9]{{1,10}}\.[0-9]{{6}})*)", re.ASCII
)
_FAILED: Final = re.compile(rf",f,({_NUMBER})", re.ASCII)
_END: Final = re.compile(rf",e,({_NUMBER})", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A block in a sample line.

    Attributes:
        state: text in the line.
        position: Besiege's components, units.
    """

    state: str
    position: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Measurements of the script in its first update.

    Attributes:
        gravity: Along the vertical, units/s²; negative downwards.
        entities: Number of objects in the level's editor; None if the mod does not report it.
        screen: (width, height) of the game's picture, pixels.
        ground: Height at each probe, units; "b" if a block is in the way, None without hit.
    """

    gravity: float
    entities: int | None
    screen: tuple[int, int]
    ground: tuple[float | str | None, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A valid line.

    Attributes:
        kind: "b", "w", "s", "p", "f" or "e".
        update: update of the script that it reports; 0 for a begin line.
        part: number of the part of a sample or of a program's figures, from 1; 0 elsewhere.
        parts: number of parts; 0 elsewhere.
        fields: of a begin line: version, key presses, digest.
        entries: of a sample line: the entry of each block, by number.
        figures: of a line of a program: its values.
        world: of a line about the level: its measurements.
        text: the whole line.
    """

    kind: str
    text: str
    update: int = 0
    part: int = 0
    parts: int = 0
    fields: tuple[int, ...] = ()
    entries: tuple[tuple[int, Entry], ...] = ()
    figures: tuple[float, ...] = ()
    world: World | None = None

    @property
    def key(self) -> tuple[int, int, int]:
        """Sort key in the order of printing; lines of one key must be equal."""
        return ("bwspfe".index(self.kind), self.update, self.part)


def line_of(text: str, prefix: str) -> Line | None:
    """Parse a line; return None unless it is complete, valid and of the run.

    Args:
        text: Line without its end.
        prefix: Beginning of the run's lines.
    """
    if len(text) > LONGEST_LINE or not text.startswith(prefix + ","):
        return None
    body, _, last = text.rpartition(",")
    if not body.isascii() or last != str(checksum(body)):
        return None
    return _read(text, body[len(prefix) :])


def _read(text: str, fields: str) -> Line | None:
    if match := _SAMPLE.fullmatch(fields):
        update, part, parts = (int(match[i]) for i in (1, 2, 3))
        sound = 1 <= part <= parts and update > 0
        entries = _entries(match[4])
        line = Line(kind="s", text=text, update=update, part=part, parts=parts, entries=entries)
        return line if sound else None
    if match := _FIGURES.fullmatch(fields):
        update, part, parts = (int(match[i]) for i in (1, 2, 3))
        figures = tuple(map(float, match[4].split(",")[1:]))
        line = Line(kind="p", text=text, update=update, part=part, parts=parts, figures=figures)
        return line if 1 <= part <= parts and update > 0 else None
    if match := _FAILED.fullmatch(fields):
        return Line(kind="f", text=text, update=int(match[1]))
    if match := _END.fullmatch(fields):
        return Line(kind="e", text=text, update=int(match[1]))
    if match := _WORLD.fullmatch(fields):
        return Line(kind="w", text=text, world=_world(match))
    match = _BEGIN.fullmatch(fields)
    return match and Line(kind="b", text=text, fields=tuple(int(match[i]) for i in (1, 2, 3)))


def _world(match: re.Match[str]) -> World:
    fields = match[5].split(",")[1:]
    return World(
        gravity=_float(match[1]),
        entities=None if match[2] == "-" else int(match[2]),
        screen=(int(match[3]), int(match[4])),
        ground=tuple(
            None if field == "-" else field if field == "b" else _float(field) for field in fields
        ),
    )


def _entries(text: str) -> tuple[tuple[int, Entry], ...]:
    fields = text.split(",")[1:]
    rows = [fields[i : i + _FIELDS_OF_ENTRY] for i in range(0, len(fields), _FIELDS_OF_ENTRY)]
    return tuple(
        (int(number), Entry(state=state, position=(_float(x), _float(y), _float(z))))
        for number, state, x, y, z in rows
    )


def _float(text: str) -> float:
    return math.nan if text == "nan" else float(text)
