"""Lock for one runner per game: two that share mouse and keyboard disturb each other's runs."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from pathlib import Path
from typing import IO

from buildarena_simworker.besiege.errors import NotSetUpError


class GameLock:
    """A lock that its process holds until it is released or the process ends.

    Args:
        game: Resource that must not be used twice: a screen, or a game's own folder.

    Raises:
        NotSetUpError: Another runner holds it; the message names it.
    """

    def __init__(self, game: str) -> None:
        name = hashlib.sha256(game.encode("utf-8", "replace")).hexdigest()[:16]
        self.file = Path(tempfile.gettempdir()) / f"buildarena-game-{name}.lock"
        self._held: IO[bytes] | None = self.file.open("a+b")
        if not _locked(self._held):
            holder = _holder(self._held)
            self._held.close()
            self._held = None
            raise NotSetUpError(
                f"another runner plays this game ({holder}): stop it first, as both would use the "
                "same mouse and keyboard"
            )
        self._held.seek(1)
        self._held.truncate()
        self._held.write(f"process {os.getpid()}".encode())
        self._held.flush()

    def release(self) -> None:
        """Release the lock for the next runner."""
        if self._held is not None:
            self._held.close()
            self._held = None


def screen_name() -> str:
    """Return a name that distinguishes this process's screen from others on the machine."""
    if sys.platform == "win32":
        return f"the screen of {os.environ.get('USERNAME') or os.environ.get('USER', '')}"
    return f"the screen {os.environ.get('DISPLAY', '')}"


def _locked(file: IO[bytes]) -> bool:
    """Try to lock a file's first byte without waiting, and return the success."""
    try:
        if sys.platform == "win32":
            import msvcrt

            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _holder(file: IO[bytes]) -> str:
    try:
        file.seek(1)
        return file.read(40).decode("utf-8", "replace").strip("\0 ") or "unknown"
    except OSError:
        return "unknown"
