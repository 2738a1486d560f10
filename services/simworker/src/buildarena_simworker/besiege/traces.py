"""Record of a run's files on the machine, so that the next runner can clean them up."""

from __future__ import annotations

import json
from pathlib import Path


def write_whole(file: Path, data: bytes) -> None:
    """Write a file atomically, and create its folder."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + ".part")
    part.write_bytes(data)
    part.replace(file)


class Traces:
    """Notes which machine file a run put into the game's folder.

    Args:
        state: The runner's own folder.
    """

    def __init__(self, state: Path) -> None:
        self._note = state / "run.json"

    @property
    def left(self) -> bool:
        """True if a run was started and never cleaned up."""
        return self._note.exists()

    def put(self, file: Path, data: bytes) -> None:
        """Write a machine file into the game's folder, after recording it."""
        write_whole(self._note, json.dumps({"file": str(file)}).encode())
        write_whole(file, data)

    def remove(self) -> None:
        """Remove the machine file and then the record."""
        try:
            file = Path(json.loads(self._note.read_text(encoding="utf-8"))["file"])
        except (OSError, ValueError, KeyError, TypeError):
            file = None
        if file is not None and file.suffix == ".bsg":
            file.unlink(missing_ok=True)
            file.with_name(file.name + ".part").unlink(missing_ok=True)
        self._note.unlink(missing_ok=True)
