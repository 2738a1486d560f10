"""Where the game's log comes from when it is not copied from its window."""

from __future__ import annotations

from pathlib import Path


class LogFile:
    """A file to which the game, or a mod, appends its log.

    Args:
        file: The file; it may not be there yet, and may be begun anew.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._read = 0
        self._rest = b""

    def skip(self) -> None:
        """Leaves out what is there already."""
        self._read = self._size()
        self._rest = b""

    def read(self) -> str:
        """The whole lines that were added since the last call."""
        size = self._size()
        if size < self._read:
            self.skip_to_start()
        if size == self._read:
            return ""
        with self._file.open("rb") as file:
            file.seek(self._read)
            data = file.read()
        self._read += len(data)
        whole, newline, self._rest = (self._rest + data).rpartition(b"\n")
        return (whole + newline).decode("utf-8", "replace")

    def skip_to_start(self) -> None:
        """Reads the file from its beginning again."""
        self._read, self._rest = 0, b""

    def _size(self) -> int:
        try:
            return self._file.stat().st_size
        except OSError:
            return 0
