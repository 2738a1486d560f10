"""The mod's log window: newest line first, a limited number of lines."""

import random
from collections import deque
from collections.abc import Sequence
from typing import Final

KEPT: Final = 301
"""Lines that the window keeps: one goes when there are more than 300."""


class LogWindow:
    """What the log window shows."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque(maxlen=KEPT)
        self._draw = random.Random(0)

    def append(self, printed: Sequence[str], *, loses: bool) -> None:
        """Takes the lines printed since the last frame, oldest first; some may be lost."""
        for line in printed:
            if not loses or self._draw.random() > 0.3:
                self._lines.appendleft(line)

    def clear(self) -> None:
        """Empties it, as a new simulation does."""
        self._lines.clear()

    @property
    def count(self) -> int:
        """How many lines there are; without any the window is not drawn."""
        return len(self._lines)

    def text(self) -> str:
        """All its lines."""
        return "\n".join(self._lines)
