"""What commands print: JSON for programs, aligned columns for people.

Piped output is never wrapped, cut or boxed: a table is a line of headings and one line for each
row, with at least two spaces between columns and ``-`` for nothing. On a terminal, columns give
way to its width in the order that their table states; ids never do, and are never broken: when
even they do not fit, the line is longer than the terminal.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TextIO

GAP = "  "
NOTHING = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a table.

    Attributes:
        name: Its heading.
        right: Whether it is aligned to the right, as figures are.
        leaves: When it gives way on a narrow terminal: 1 is the first to go; 0 never goes.
    """

    name: str
    right: bool = False
    leaves: int = 0


def columns(*names: str, numeric: Sequence[str] = (), leaving: Sequence[str] = ()) -> list[Column]:
    """Columns by their names.

    Args:
        names: All of them, from left to right.
        numeric: Those aligned to the right.
        leaving: Those that give way, the first to go first.
    """
    return [
        Column(
            name=name,
            right=name in numeric,
            leaves=leaving.index(name) + 1 if name in leaving else 0,
        )
        for name in names
    ]


def say(text: str = "") -> None:
    """One or more lines on standard output, whole however wide the terminal is."""
    _write(sys.stdout, harmless(text) + "\n")


def warn(text: str) -> None:
    """One or more lines on standard error."""
    _write(sys.stderr, harmless(text) + "\n")


def print_json(value: Any) -> None:
    """One JSON document on standard output."""
    _write(sys.stdout, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def print_table(
    shown: Sequence[Column],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "",
    notes: Sequence[str] = (),
) -> None:
    """A table; on a terminal as wide as that is, elsewhere as wide as it must be.

    Args:
        shown: Its columns.
        rows: Cells by row; an empty one is shown as a dash.
        title: A line above.
        notes: Lines below on a terminal; a pipe gets headings and rows alone.
    """
    cells = [[_cell(text) for text in row] for row in rows]
    fitting = list(range(len(shown)))
    if is_terminal():
        fitting = _fitting(shown, cells, terminal_width())
    widths = [max(width_of(line[i]) for line in [_names(shown), *cells]) for i in fitting]
    lines = [_line(shown, fitting, widths, row) for row in cells]
    head = _line(shown, fitting, widths, _names(shown))
    gone = [column.name for i, column in enumerate(shown) if i not in fitting]
    below = [*notes, *([f"too narrow for: {', '.join(gone)}"] if gone else [])]
    if not is_terminal():
        below = []
    print_lines(
        [*([title] if title else []), emphasised(head), *lines, *(_faint(note) for note in below)]
    )


def print_lines(lines: Sequence[str]) -> None:
    """Lines that are harmless already, written at once."""
    _write(sys.stdout, "".join(f"{line}\n" for line in lines))


def number(value: float | None, digits: int = 1, *, at_least: bool = False) -> str:
    """A number for people; a dash for nothing, a mark for what may be greater."""
    if value is None:
        return NOTHING
    return ("≥ " if at_least else "") + f"{value:,.{digits}f}"


def minute_of(timestamp: str) -> str:
    """An ISO 8601 timestamp to the minute, for people."""
    return timestamp[:16].replace("T", " ")


def in_words(indicator: str, unit: str) -> str:
    """An indicator with its unit, if it has one."""
    name = indicator.replace("_", " ")
    return name if unit in {"", "1"} else f"{name} in {unit}"


def is_terminal() -> bool:
    """Whether a person looks at standard output."""
    return sys.stdout.isatty()


def terminal_width() -> int:
    """Columns of the terminal, or what COLUMNS says."""
    return shutil.get_terminal_size().columns


def width_of(text: str) -> int:
    """How many columns of a terminal a text takes."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(c) else 1 + (unicodedata.east_asian_width(c) in "WF")
        for c in text
    )


def padded(text: str, width: int, *, right: bool = False) -> str:
    """A text with the spaces that make it this wide."""
    spaces = " " * (width - width_of(text))
    return spaces + text if right else text + spaces


def emphasised(text: str) -> str:
    """A heading, bold where the terminal can show it."""
    return f"\x1b[1m{text}\x1b[0m" if _styled() else text


def _faint(text: str) -> str:
    return f"\x1b[2m{text}\x1b[0m" if _styled() else text


def _styled() -> bool:
    return is_terminal() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def harmless(text: str) -> str:
    r"""A text whose control characters are spelled (``\x1b``): names come from strangers."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def _names(shown: Sequence[Column]) -> list[str]:
    return [column.name for column in shown]


def _fitting(shown: Sequence[Column], cells: Sequence[Sequence[str]], room: int) -> list[int]:
    """Which columns fit: those that may leave do so one by one, in their order."""
    widths = [max(width_of(line[i]) for line in [_names(shown), *cells]) for i in range(len(shown))]
    fitting = list(range(len(shown)))
    for i in sorted(fitting, key=lambda i: shown[i].leaves):
        if sum(widths[k] for k in fitting) + len(GAP) * (len(fitting) - 1) <= room:
            break
        if shown[i].leaves:
            fitting.remove(i)
    return fitting


def _line(
    shown: Sequence[Column], fitting: Sequence[int], widths: Sequence[int], row: Sequence[str]
) -> str:
    parts = [
        padded(row[i], width, right=shown[i].right)
        for i, width in zip(fitting, widths, strict=True)
    ]
    return GAP.join(parts).rstrip()


def _cell(text: str) -> str:
    """A text in one line."""
    return harmless(text.replace("\n", " ").replace("\t", " ")) or NOTHING


def _write(stream: TextIO, text: str) -> None:
    # Flushed here, so that a closed pipe is noticed where it is handled.
    stream.write(text)
    stream.flush()
