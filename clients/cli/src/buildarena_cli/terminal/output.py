"""Output of commands: JSON for programs, aligned columns for people.

Nothing is wrapped, cut or boxed: a table is a line of headings and one line for each row, with at
least two spaces between columns and ``-`` for nothing.
"""

from __future__ import annotations

import json
import os
import sys
import unicodedata
from collections.abc import Sequence
from typing import Any, TextIO

GAP = "  "
NOTHING = "-"


def say(text: str = "") -> None:
    """Print lines on standard output, uncut even in a narrow terminal."""
    _write(sys.stdout, harmless(text) + "\n")


def warn(text: str) -> None:
    """Print lines on standard error."""
    _write(sys.stderr, harmless(text) + "\n")


def print_json(value: Any) -> None:
    """Print a JSON document on standard output."""
    _write(sys.stdout, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def print_table(
    names: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    numeric: Sequence[str] = (),
    title: str = "",
    notes: Sequence[str] = (),
) -> None:
    """Print a table of the required width: a line of headings, and one for each row.

    Args:
        names: Headings of the columns.
        rows: Cells by row; an empty one is printed as a dash.
        numeric: Headings of columns that are aligned to the right.
        title: Line above the table, on a terminal only.
        notes: Lines below the table, on a terminal only.
    """
    cells = [list(names), *([_cell(text) for text in row] for row in rows)]
    widths = [max(map(width_of, column)) for column in zip(*cells, strict=True)]
    head, *lines = (_line(names, row, widths, numeric) for row in cells)
    below = [_faint(note) for note in notes] if is_terminal() else []
    shown = [*([title] if title else []), emphasised(head), *lines, *below]
    _write(sys.stdout, "".join(f"{line}\n" for line in shown))


def number(value: float | None, digits: int = 1, *, at_least: bool = False) -> str:
    """Format a number; None as a dash, a lower bound with a mark."""
    if value is None:
        return NOTHING
    return ("≥ " if at_least else "") + f"{value:,.{digits}f}"


def minute_of(timestamp: str) -> str:
    """Format an ISO 8601 timestamp to the minute."""
    return timestamp[:16].replace("T", " ")


def in_words(indicator: str, unit: str) -> str:
    """Return an indicator with its unit, if it has one."""
    name = indicator.replace("_", " ")
    return name if unit in {"", "1"} else f"{name} in {unit}"


def is_terminal() -> bool:
    """Return whether standard output is a terminal."""
    return sys.stdout.isatty()


def width_of(text: str) -> int:
    """Return the width of a text in terminal columns."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(c) else 1 + (unicodedata.east_asian_width(c) in "WF")
        for c in text
    )


def emphasised(text: str) -> str:
    """Return a heading, bold where the terminal can show it."""
    return f"\x1b[1m{text}\x1b[0m" if _styled() else text


def _faint(text: str) -> str:
    return f"\x1b[2m{text}\x1b[0m" if _styled() else text


def _styled() -> bool:
    return is_terminal() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def harmless(text: str) -> str:
    r"""Return an untrusted text with its control characters escaped (``\x1b``)."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def _line(
    names: Sequence[str], row: Sequence[str], widths: Sequence[int], numeric: Sequence[str]
) -> str:
    parts = []
    for name, cell, width in zip(names, row, widths, strict=True):
        spaces = " " * (width - width_of(cell))
        parts.append(spaces + cell if name in numeric else cell + spaces)
    return GAP.join(parts).rstrip()


def _cell(text: str) -> str:
    """Return a text in one line."""
    return harmless(text.replace("\n", " ").replace("\t", " ")) or NOTHING


def _write(stream: TextIO, text: str) -> None:
    # Flushed here, so that a closed pipe is noticed where it is handled.
    stream.write(text)
    stream.flush()
