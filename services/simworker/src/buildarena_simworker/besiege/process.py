"""The game's process: started, found again after the runner died, and ended for certain."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import psutil

from buildarena_simworker.besiege.errors import GameGoneError
from buildarena_simworker.besiege.settings import BesiegeSettings, level_digest
from buildarena_simworker.besiege.traces import write_whole

_SECRET: Final = re.compile(
    r"(KEY|TOKEN|SECRET|PASSWORD|CREDENTIALS)(_FILE)?$|^BUILDARENA_(DATABASE|BROKER)_",
    re.IGNORECASE,
)
"""Environment variables that the game does not get."""
END_S: Final = 5.0
"""Time limit for a game to end before it is killed, seconds."""


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
        """True if a command was set."""
        return bool(self._settings.command)

    @property
    def output(self) -> Path:
        """File for its output."""
        return self._settings.state / "game.log"

    def last_words(self) -> str:
        """Return the last line that it printed."""
        try:
            lines = self.output.read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            lines = []
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    @property
    def level(self) -> str | None:
        """Digest of the level it was started with; None when it was not started here."""
        return None if self._process() is None else str(self._known().get("level"))

    @property
    def started(self) -> bool:
        """True if a runner started it; otherwise a person did, and the game outlives the runner."""
        return bool(self._known().get("started"))

    def is_running(self) -> bool:
        """Check if the game that was started here still runs."""
        return self._process() is not None

    def awaited(self) -> bool:
        """Check if the game may still show its window: it runs, or its launcher handed over.

        A launcher ends, or runs next to the game, once it handed over. It is never started again
        while the game may still be starting, or several games would start.
        """
        return self.is_running() or (self._child is not None and self._child.poll() == 0)

    def adopt(self, pid: int | None) -> None:
        """Use the process of the game's window as the game, if a launcher started it.

        Args:
            pid: Process of the window; None if the screen does not report it, and the name must
                suffice.
        """
        record = self._known()
        if pid is None and not self.is_running():
            candidates = sorted(self._others(), key=lambda other: other.create_time())
            pid = candidates[-1].pid if candidates else None
        if pid is None or pid == record.get("pid"):
            return
        if not self._settings.executable and pid in self._children():
            return
        self._note(pid, str(record.get("level", "")), started=self.started)

    def start(self, level: bytes | None) -> subprocess.Popen[str]:
        """Start it, with a level if the command opens one.

        Args:
            level: Bytes of the level file; None for the sandbox.

        Raises:
            GameGoneError: There is no command, or it fails.
        """
        if not self.can_start:
            raise GameGoneError(
                "the game does not run: start it, or set BUILDARENA_BESIEGE_COMMAND"
            )
        command = self._settings.words(self._level_file(level))
        with self.output.open("ab") as log:
            try:
                process = subprocess.Popen(
                    command,
                    env={n: v for n, v in os.environ.items() if not _SECRET.search(n)},
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    text=True,
                    encoding="utf-8",
                    errors="replace",
                    **_apart(),
                )
            except OSError as error:
                raise GameGoneError(f"the game cannot be started: {error}") from error
        self._child = process
        self._note(process.pid, level_digest(level), started=True)
        return process

    def kill(self) -> None:
        """End it, all processes it started, and games that a launcher left on this screen.

        A machine has one game: another one would take the keyboard, and Steam does not start a
        second.
        """
        process = self._process()
        family = [] if process is None else [process]
        with suppress(psutil.NoSuchProcess):
            family += [] if process is None else process.children(recursive=True)
        if self.can_start:
            family += [other for other in self._others() if other not in family]
        for member in family:
            with suppress(psutil.Error):
                member.terminate()
        _, alive = psutil.wait_procs(family, timeout=END_S)
        for member in alive:
            with suppress(psutil.Error):
                member.kill()
        psutil.wait_procs(alive, timeout=END_S)
        # A launcher may run on next to the game that it started.
        game = None if process is None else process.pid
        if self._child is not None and game in {None, self._child.pid}:
            self._child.wait()
        self._child = None
        self._file.unlink(missing_ok=True)

    def _level_file(self, level: bytes | None) -> Path | None:
        """Write the level to a file for the game; None for the sandbox."""
        if level is None:
            return None
        file = self._settings.state / "levels" / f"{level_digest(level)}.blv"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(level)
        return file.absolute()

    def _children(self) -> set[int]:
        """Return the processes started by the first one, which may own its window."""
        process = self._process()
        with suppress(psutil.NoSuchProcess):
            return set() if process is None else {child.pid for child in process.children(True)}
        return set()

    def _note(self, pid: int, level: str, *, started: bool) -> None:
        with suppress(psutil.NoSuchProcess):
            created = psutil.Process(pid).create_time()
            record = {"pid": pid, "created": created, "level": level, "started": started}
            write_whole(self._file, json.dumps(record).encode())

    def _others(self) -> list[psutil.Process]:
        """Return processes of the game's name that this account runs on this screen."""
        stem = executable_stem(self._settings.executable)
        own = psutil.Process()
        processes = []
        for process in psutil.process_iter():
            with suppress(psutil.Error, OSError):
                if (
                    stem
                    and executable_stem(process.name()) == stem
                    and process.username() == own.username()
                    and _screen_of(process) == _screen_of(own)
                    and process.status() != psutil.STATUS_ZOMBIE
                ):
                    processes.append(process)
        return processes

    def _known(self) -> dict[str, Any]:
        try:
            record = json.loads(self._file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return record if isinstance(record, dict) else {}

    def _process(self) -> psutil.Process | None:
        record = self._known()
        try:
            process = psutil.Process(int(record["pid"]))
            same = abs(process.create_time() - float(record["created"])) < 1.0
            alive = process.status() != psutil.STATUS_ZOMBIE
        except (KeyError, ValueError, psutil.NoSuchProcess):
            return None
        return process if same and alive else None


def executable_stem(name: str) -> str:
    """Return a program's name in lower case, without its system's extension."""
    stem = name.strip().casefold()
    for ending in (".exe", ".x86_64", ".x86", ".app"):
        stem = stem.removesuffix(ending)
    return stem


def _screen_of(process: psutil.Process) -> str:
    """Return the X11 screen of a process's windows; the same value for all elsewhere."""
    if sys.platform == "win32":
        return ""
    return str(process.environ().get("DISPLAY", ""))


def _apart() -> Mapping[str, Any]:
    """Return options that isolate the game from the runner's signals and death."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}
