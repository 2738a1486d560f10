"""The mod's log window: newest line first, a limited number of lines."""

import random
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from support.game.stand_in_game.faults import Fault

KEPT: Final = 301
"""Lines that the window keeps: one goes when there are more than 300."""


class LogWindow:
    """What the log window shows."""

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._lines: deque[str] = deque(maxlen=KEPT)
        self._draw = random.Random(0)
        self.version = 0

    def append(self, printed: Sequence[str], faults: Sequence[Fault]) -> None:
        """Takes the lines printed since the last frame, oldest first, through the faults."""
        for line in printed:
            for shown in self._through(line, faults):
                self._lines.appendleft(shown)
                self.version += 1
        if self._file is not None and printed:
            with self._file.open("a", encoding="utf-8") as log:
                log.writelines(f"{line}\n" for line in printed)

    def clear(self) -> None:
        """Empties it, as a new simulation does."""
        self._lines.clear()
        self.version += 1

    @property
    def count(self) -> int:
        """How many lines there are; without any the window is not drawn."""
        return len(self._lines)

    def text(self, *, below: int = 0) -> str:
        """All its lines.

        Args:
            below: how many of the newest are scrolled out of reach.
        """
        return "\n".join(list(self._lines)[below:])

    def _through(self, line: str, faults: Sequence[Fault]) -> list[str]:
        shown = [line]
        for fault in faults:
            if fault.kind == "cut_lines":
                shown = [text[: int(fault.number("column", 40))] for text in shown]
            elif fault.kind == "lost_lines" and self._draw.random() < fault.number("share", 0.3):
                shown = []
            elif fault.kind == "repeat_lines" and self._draw.random() < fault.number("share", 0.3):
                shown = shown * 2
        return shown
