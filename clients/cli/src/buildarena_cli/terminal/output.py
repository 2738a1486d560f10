"""Output of commands: JSON for programs, aligned columns for people.

Nothing is wrapped, cut or boxed: a table is a line of headings and one line for each row, with at
least two spaces between columns and ``-`` for nothing.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TextIO

GAP = "  "
NOTHING = "-"
FIGURE = frozenset("0123456789.,+-±≥/%$ ")
"""Letters of numbers, dashes, shares and intervals."""
BOLD, FAINT = "\x1b[1m", "\x1b[2m"


def print_line(text: str = "") -> None:
    """Print lines on standard output, uncut even in a narrow terminal."""
    _write(sys.stdout, harmless(text) + "\n")


def warn(text: str) -> None:
    """Print lines on standard error."""
    _write(sys.stderr, harmless(text) + "\n")


def print_json(value: Any) -> None:
    """Print a JSON document on standard output."""
    _write(sys.stdout, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def print_table(
    names: Iterable[str],
    rows: Iterable[Iterable[str]],
    *,
    title: str = "",
    notes: Iterable[str] = (),
) -> None:
    """Print a table of the required width: a line of headings, and one for each row.

    Columns of numbers are aligned to the right.

    Args:
        names: Headings of the columns.
        rows: Cells by row; an empty one is printed as a dash.
        title: Line above the table.
        notes: Lines below the table, on a terminal only.
    """
    from rich.cells import cell_len

    cells = [[_cell(text) for text in row] for row in rows]
    columns = []
    for name, *column in zip(names, *cells, strict=True):
        width = max(map(cell_len, (name, *column)))
        align = str.rjust if all(map(FIGURE.issuperset, column)) else str.ljust
        # A wide letter counts once for Python, and twice on a terminal.
        columns.append([align(c, width - cell_len(c) + len(c)) for c in (name, *column)])
    head, *lines = (GAP.join(row).rstrip() for row in zip(*columns, strict=True))
    below = [_styled(note, FAINT) for note in notes] if is_terminal() else []
    shown = [*([_styled(title, BOLD)] if title else []), _styled(head, BOLD), *lines, *below]
    _write(sys.stdout, "".join(f"{line}\n" for line in shown))


def print_rows(
    columns: Mapping[str, Callable[[Any], str]], rows: Iterable[Any], **more: Any
) -> None:
    """Print a table of objects.

    Args:
        columns: By heading, what shows an object's cell.
        rows: Objects by row.
        more: Title and notes, see `print_table`.
    """
    print_table(columns, ([cell(row) for cell in columns.values()] for row in rows), **more)


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


def _styled(text: str, style: str) -> str:
    """Return a text in a style, where the terminal can show it."""
    plain = not is_terminal() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return text if plain else f"{style}{text}\x1b[0m"


def harmless(text: str) -> str:
    r"""Return an untrusted text with its control characters escaped (``\x1b``)."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def _cell(text: str) -> str:
    """Return a text in one line."""
    return harmless(text.replace("\n", " ").replace("\t", " ")) or NOTHING


def _write(stream: TextIO, text: str) -> None:
    # Flushed here, so that a closed pipe is noticed where it is handled.
    stream.write(text)
    stream.flush()
