"""The toolkit's command line as a process: started, watched, and ended with all it started."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

import psutil

from buildarena_simworker_besiege.errors import NotSetUpError, StepFailedError
from buildarena_simworker_besiege.process import END_S, GameProcess
from buildarena_simworker_besiege.settings import BesiegeSettings

COMMAND: Final = (
    "python -m besiege_cli run --bsg {bsg} --controller {controller} --sandbox {sandbox} "
    "--telemetry-hz {hz}"
)
"""The command that public projects use, with what is filled in."""
FOLDER: Final = "{folder}"
MAX_OUTPUT: Final = 64 << 20
"""Bytes that a command may print."""
_POLL_S: Final = 0.05
_LOOK_S: Final = 0.5


def toolkit_settings(settings: BesiegeSettings) -> BesiegeSettings:
    """The settings with the toolkit's usual command where none is set."""
    return settings.model_copy(update={"command": settings.command or COMMAND})


def require_toolkit(settings: BesiegeSettings) -> None:
    """Checks that the command can be run, and where it leaves its runs.

    Raises:
        NotSetUpError: Something is missing; the message says what to do.
    """
    own = toolkit_settings(settings)
    try:
        words = own.words(None)
    except ValueError as error:
        raise NotSetUpError(f"{error}: correct BUILDARENA_BESIEGE_COMMAND") from error
    missing = [name for name in ("{bsg}", "{controller}", "{sandbox}") if name not in own.command]
    if missing:
        raise NotSetUpError(
            f"the command says nothing of {', '.join(missing)}: correct BUILDARENA_BESIEGE_COMMAND"
        )
    if shutil.which(words[0]) is None:
        raise NotSetUpError(
            f"there is no program {words[0]}: install the toolkit, or correct "
            "BUILDARENA_BESIEGE_COMMAND"
        )
    if FOLDER not in own.command and (own.runs is None or not own.runs.is_dir()):
        raise NotSetUpError(
            "where the toolkit leaves its runs is not known: set BUILDARENA_BESIEGE_RUNS to that "
            "folder, or name {folder} in BUILDARENA_BESIEGE_COMMAND"
        )


class ToolkitCommand:
    """The one command that this runner has running.

    Args:
        settings: The command, and the runner's own folder.
    """

    def __init__(self, settings: BesiegeSettings) -> None:
        self._settings = settings
        self._process = GameProcess(settings)
        self._family: dict[int, psutil.Process] = {}

    def run(
        self,
        values: Mapping[str, str],
        level: bytes | None,
        *,
        limit_s: float,
        require_held: Callable[[], None],
    ) -> float:
        """Runs the command to its end.

        Args:
            values: What its placeholders stand for.
            level: The level file's bytes; None for a sandbox.
            limit_s: How long it may take.
            require_held: Raises when the lease is lost.

        Returns:
            How long it took, seconds.

        Raises:
            GameGoneError: It cannot be started.
            StepFailedError: It took too long, printed too much, or failed.
        """
        words = self._settings.words(self._process.level_file(level))
        for name, value in values.items():
            words = [word.replace(name, value) for word in words]
        self.end()
        self._process.output.unlink(missing_ok=True)
        started = time.monotonic()
        child = self._process.start(level, words=words)
        looked = 0.0
        try:
            while (code := child.poll()) is None:
                now = time.monotonic()
                if now - looked > _LOOK_S:
                    looked = now
                    require_held()
                    self._look(child.pid)
                if now - started > limit_s:
                    raise StepFailedError("run the toolkit", f"no end after {limit_s:.0f} s")
                time.sleep(_POLL_S)
        finally:
            self.end()
        if code != 0:
            finding = f"it ended with code {code}: {self._process.last_words()[:300]}"
            raise StepFailedError("run the toolkit", finding)
        return time.monotonic() - started

    def level_file(self, level: bytes) -> Path:
        """A level as a file for the game."""
        file = self._process.level_file(level)
        assert file is not None  # noqa: S101  there is a level
        return file

    def end(self) -> None:
        """Ends it and everything it started, also of a runner before this one."""
        self._process.kill()
        left = [process for process in self._family.values() if process.is_running()]
        self._family = {}
        for process in left:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(left, timeout=END_S)

    def output(self) -> bytes:
        """The end of what it printed."""
        try:
            return self._process.output.read_bytes()[-65_536:]
        except OSError:
            return b""

    def _look(self, pid: int) -> None:
        """Notes what it started, which may outlive it; and how much it printed."""
        with suppress(psutil.NoSuchProcess):
            for child in psutil.Process(pid).children(recursive=True):
                self._family.setdefault(child.pid, child)
        with suppress(OSError):
            if self._process.output.stat().st_size > MAX_OUTPUT:
                raise StepFailedError("run the toolkit", f"it printed over {MAX_OUTPUT:,} bytes")


def new_folder(state: Path, run_id: str) -> Path:
    """An empty folder for a run; those of earlier runs are removed."""
    root = state / "toolkit"
    shutil.rmtree(root, ignore_errors=True)
    folder = root / run_id
    (folder / "run").mkdir(parents=True)
    return folder.absolute()
