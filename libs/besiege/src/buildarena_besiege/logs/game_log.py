"""Content of the log window or a stream about one run."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final
from urllib.parse import unquote

from buildarena_besiege.keys import UPDATES_PER_S
from buildarena_besiege.logs.log_lines import LONGEST_LINE, Line, World, line_of
from buildarena_besiege.run import marked

_LINE_ENDS: Final = re.compile(r"\r\n|\r|\n")
_BEGINNINGS: Final = re.compile(r"ba,([A-Za-z0-9_.~%-]{1,200}),b,")
_AROUND: Final = " \t\x00\ufeff\xa0"
_COMPLAINING: Final = re.compile(
    r"lua|attempt to |stack traceback|(?<![a-z])error\b", re.IGNORECASE
)
_MAX_COMPLAINTS: Final = 50
_LONGEST_COMPLAINT: Final = 500


def run_ids(text: str) -> tuple[str, ...]:
    """Return the ids of the runs whose begin lines are complete in a text, in their order."""
    marks = dict.fromkeys(match[1] for match in _BEGINNINGS.finditer(text))
    return tuple(
        run
        for run in map(unquote, marks)
        if any(line_of(row, marked(run)) for row in _begin_lines(text, marked(run)))
    )


def _begin_lines(text: str, prefix: str) -> list[str]:
    return re.findall(rf"{re.escape(prefix)},b,[0-9,]+", text)[:_MAX_COMPLAINTS]


class GameLog:
    """The lines of one run, from any number of copies of the log window or pieces of a stream.

    A line counts only if it is whole by its check sum and of this run. Order, repeats, half lines,
    other runs' lines and foreign text do not matter.

    Args:
        run_id: The run's id.
    """

    def __init__(self, run_id: str) -> None:
        self.run_id = run_id
        self._prefix = marked(run_id)
        # Lines may be glued together: each begins at the run's mark.
        self._begins = re.compile(f"(?={re.escape(self._prefix)},)")
        self._lines: dict[str, Line] = {}
        self._complaints: dict[str, None] = {}
        self._tail = ""

    def read(self, text: str) -> None:
        """Read a copy of the window, or the new part of a stream.

        Args:
            text: Any text.
        """
        rows = _LINE_ENDS.split(text)
        if self._tail:
            # A stream may be cut anywhere; a copy's rows do not fit the tail and fail their sums.
            joined = self._tail + rows[0]
            self._complaints.pop(self._tail[:_LONGEST_COMPLAINT].strip(_AROUND), None)
            self._take(joined)
            self._tail = joined if len(rows) == 1 else rows[-1]
        else:
            self._tail = rows[-1]
        self._tail = self._tail[-LONGEST_LINE:]
        for row in rows:
            self._take(row)

    @property
    def begun(self) -> bool:
        """True once the begin line was read."""
        return any(line.kind == "b" for line in self._lines.values())

    @property
    def world(self) -> World | None:
        """Measurements of the level by the script; None before."""
        return next((line.world for line in self._lines.values() if line.kind == "w"), None)

    @property
    def ended(self) -> bool:
        """True once the end line was read."""
        return any(line.kind == "e" for line in self._lines.values())

    @property
    def time_s(self) -> float:
        """The script's time in the newest line, seconds; 0.0 before."""
        return max((line.update for line in self._lines.values()), default=0) / UPDATES_PER_S

    @property
    def complaints(self) -> tuple[str, ...]:
        """Foreign lines that speak of a Lua error."""
        return tuple(self._complaints)

    @property
    def lines(self) -> tuple[Line, ...]:
        """The lines that count, in the order of printing; of two that differ both."""
        return tuple(sorted(self._lines.values(), key=lambda line: (line.key, line.text)))

    @property
    def disputed(self) -> Mapping[tuple[int, int, int], int]:
        """The keys of which there are lines that differ, with their number."""
        counts: dict[tuple[int, int, int], int] = {}
        for line in self._lines.values():
            counts[line.key] = counts.get(line.key, 0) + 1
        return {key: count for key, count in counts.items() if count > 1}

    def text(self) -> str:
        """Return every valid line, in order; a log that reads it equals this one."""
        return "".join(f"{line.text}\n" for line in self.lines)

    def __eq__(self, other: object) -> bool:
        """Compare the lines and the runs."""
        if not isinstance(other, GameLog):
            return NotImplemented
        return self.run_id == other.run_id and self._lines.keys() == other._lines.keys()

    __hash__ = None  # type: ignore[assignment]  # it grows

    def __repr__(self) -> str:
        return f"GameLog({self.run_id!r}, {len(self._lines)} lines, {self.time_s} s)"

    def _take(self, row: str) -> None:
        row = row.strip(_AROUND)
        if not row or row in self._lines:
            return
        if self._prefix not in row:
            self._note_complaint(row)
            return
        for segment in self._begins.split(row):
            text = segment.strip(_AROUND)
            if text in self._lines:
                continue
            line = line_of(text, self._prefix)
            if line is not None:
                self._lines[text] = line
            else:
                # A half line of ours may have a foreign one glued to it.
                self._note_complaint(text.removeprefix(self._prefix))

    def _note_complaint(self, row: str) -> None:
        if row.startswith("ba,") or len(self._complaints) >= _MAX_COMPLAINTS:
            return
        row = row[:_LONGEST_COMPLAINT].strip(_AROUND)
        if _COMPLAINING.search(row):
            self._complaints[row] = None
