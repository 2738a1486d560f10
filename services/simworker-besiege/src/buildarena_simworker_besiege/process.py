"""The game's process: started, found again after the runner died, and ended for certain."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import psutil

from buildarena_simworker_besiege.errors import GameGoneError
from buildarena_simworker_besiege.settings import BesiegeSettings, level_digest
from buildarena_simworker_besiege.whole_files import write_whole

END_S: Final = 5.0
"""How long a game may take to end before it is killed."""


class GameProcess:
    """The one game that this runner plays.

    What it knows is stored in a file: a runner that follows a dead one finds the same game.

    Args:
        settings: The command that starts it, and where to keep its pid.
    """

    def __init__(self, settings: BesiegeSettings) -> None:
        self._settings = settings
        self._file = settings.state / "game.json"
        self._child: subprocess.Popen[str] | None = None
        settings.state.mkdir(parents=True, exist_ok=True)

    @property
    def can_start(self) -> bool:
        """Whether a command was set."""
        return bool(self._settings.command)

    @property
    def output(self) -> Path:
        """Where what it prints is written."""
        return self._settings.state / "game.log"

    def last_words(self) -> str:
        """The last line that it printed."""
        try:
            lines = self.output.read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            lines = []
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    @property
    def level(self) -> str | None:
        """Digest of the level it was started with; None when it was not started here."""
        return None if self._process() is None else str(self._known().get("level"))

    def is_running(self) -> bool:
        """Whether the game that was started here still runs."""
        return self._process() is not None

    def start(
        self, level: bytes | None, *, piped: bool = False, words: list[str] | None = None
    ) -> subprocess.Popen[str]:
        """Starts it, with a level where the command opens one.

        Args:
            level: The level file's bytes; None for the sandbox.
            piped: Whether its standard output is to be read through the returned process.
            words: The command, when it is not just the set one.

        Raises:
            GameGoneError: There is no command, or it cannot be run.
        """
        if not self.can_start:
            raise GameGoneError(
                "the game does not run: start it, or set BUILDARENA_BESIEGE_COMMAND"
            )
        command = words or self._settings.words(self.level_file(level))
        with self.output.open("ab") as log:
            try:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE if piped else log,
                    stderr=log,
                    text=True,
                    encoding="utf-8",
                    errors="replace",
                    **_apart(),
                )
            except OSError as error:
                raise GameGoneError(f"the game cannot be started: {error}") from error
        self._child = process
        with suppress(psutil.NoSuchProcess):
            known = {
                "pid": process.pid,
                "created": psutil.Process(process.pid).create_time(),
                "level": level_digest(level),
            }
            write_whole(self._file, json.dumps(known).encode())
        return process

    def kill(self) -> None:
        """Ends it and everything it started."""
        process = self._process()
        if process is not None:
            family = [process]
            with suppress(psutil.NoSuchProcess):
                family += process.children(recursive=True)
            for member in family:
                with suppress(psutil.NoSuchProcess):
                    member.terminate()
            _, alive = psutil.wait_procs(family, timeout=END_S)
            for member in alive:
                with suppress(psutil.NoSuchProcess):
                    member.kill()
            psutil.wait_procs(alive, timeout=END_S)
        if self._child is not None:
            self._child.wait()
            if self._child.stdout is not None:
                self._child.stdout.close()
            self._child = None
        self._file.unlink(missing_ok=True)

    def level_file(self, level: bytes | None) -> Path | None:
        """The level as a file for the game; None for the sandbox."""
        if level is None:
            return None
        file = self._settings.state / "levels" / f"{level_digest(level)}.blv"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(level)
        return file.absolute()

    def _known(self) -> dict[str, Any]:
        try:
            known = json.loads(self._file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return known if isinstance(known, dict) else {}

    def _process(self) -> psutil.Process | None:
        known = self._known()
        try:
            process = psutil.Process(int(known["pid"]))
            same = abs(process.create_time() - float(known["created"])) < 1.0
            alive = process.status() != psutil.STATUS_ZOMBIE
        except (KeyError, ValueError, psutil.NoSuchProcess):
            return None
        return process if same and alive else None


def _apart() -> Mapping[str, Any]:
    """What keeps the runner's signals, and its death, away from the game."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}
