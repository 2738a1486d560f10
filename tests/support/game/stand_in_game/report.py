"""The report: a file that says what the game is doing, for whoever watches it."""

import json
import os
from pathlib import Path


class Report:
    """Rewritten as a whole whenever it changes, so that a reader never sees half of it."""

    def __init__(self, path: Path | None) -> None:
        self._path, self._written = path, ""

    def write(self, state: dict[str, object]) -> None:
        """Writes a state, unless it is the one written last."""
        text = json.dumps({**state, "pid": os.getpid()}, indent=1)
        if self._path is None or text == self._written:
            return
        self._written = text
        fresh = self._path.with_name(f".{self._path.name}.{os.getpid()}")
        fresh.write_text(text)
        fresh.replace(self._path)
