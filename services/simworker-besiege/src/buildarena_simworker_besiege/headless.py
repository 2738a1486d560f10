"""A game without a window, driven over TCP by a plugin, that prints its state to standard output.

Source: the BesiegeField project's protocol. Frames from us: a length of four bytes, little-endian,
and the UTF-8 text "CODE ARGUMENT". Lines from the game: anything with "BesiegeAgent" and
"SendMessage:". There is no Lua in such a game, so nothing changes a cargo's mass and nothing tells
whether cannons burn: tasks that need either are refused.
"""

from __future__ import annotations

import queue
import socket
import subprocess
import threading
import time
from typing import IO, Final

from buildarena_besiege import GameRun, StateLog, level_file
from buildarena_geometry import Machine
from buildarena_pipeline.errors import PermanentError
from buildarena_simulation import Scenario, Trajectory
from buildarena_simworker_besiege.commands import command_words
from buildarena_simworker_besiege.desktop import RunLog
from buildarena_simworker_besiege.errors import (
    DesktopError,
    GameGoneError,
    StepFailedError,
)
from buildarena_simworker_besiege.game_lock import GameLock
from buildarena_simworker_besiege.process import GameProcess
from buildarena_simworker_besiege.settings import BesiegeSettings, level_digest
from buildarena_simworker_besiege.traces import Traces

SCENE, LOAD, TOGGLE, KEY, LEVEL, FAIL = 0, 2, 3, 4, 5, 6
LEVEL_EDITOR: Final = "3"
INTERVAL_S: Final = 0.2
"""Time between two lines of the game's state."""
PORTS: Final = 200
"""Ports that are tried from the first one on."""


class HeadlessDesktop:
    """Plays a game over TCP.

    Args:
        settings: Command, folders and the first port.
    """

    def __init__(self, settings: BesiegeSettings) -> None:
        self._settings = settings
        self._limits = settings.time_limits
        self._process = GameProcess(settings)
        self._traces = Traces(settings.state)
        self._lock = GameLock(f"the game of {settings.state.absolute()}")
        self._socket: socket.socket | None = None
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader: threading.Thread | None = None
        self._level: bytes | None = None
        self._open_level: str | None = None
        self._running = False
        self._log: StateLog | None = None
        self._first = ""
        self._newest_s, self._newest_at = 0.0, 0.0
        self._edges: list[tuple[float, str, bool]] = []

    @property
    def puts_down(self) -> bool:
        """No message of the protocol does it."""
        return False

    def require_able(self, run: GameRun) -> None:
        """Checks that the run needs no script."""
        if run.needs_script:
            raise PermanentError(
                "a headless game runs no script: it cannot make a cargo heavier, tell whether a "
                "cannon burns or ask a program, which this trial needs; run it in a game with a "
                "window",
                reason="needs_script",
            )

    def prepare(self, run: GameRun) -> None:
        """Brings up a game with the run's level and no machine in it."""
        left = self._traces.left
        self._traces.remove()
        self._level = run.level
        if left or self._socket is None or not self._process.is_running():
            self._start_anew()
        elif self._open_level != level_digest(run.level):
            self._enter_level()

    def load(self, run: GameRun) -> None:
        """Loads the machine file by its path."""
        folder = self._settings.machines_folder
        if folder is None:
            raise DesktopError("no folder of machine files is set")
        file = (folder / f"{run.name}.bsg").absolute()
        self._traces.put(file, run.machine_file)
        self._send(LOAD, str(file))
        self._expect("MachineLoaded", f"load the machine {run.name}", self._limits.answer_s)

    def start(self, run: GameRun) -> None:
        """Starts the simulation; keys are pressed by the game's own time."""
        self._edges = sorted(run.key_changes, key=lambda edge: edge[0])
        self._send(TOGGLE, "")
        self._first = self._expect("SimulationStart", "start the simulation", self._limits.answer_s)
        self._newest_s, self._newest_at = 0.0, time.monotonic()
        self._running = True

    def new_log(self, run: GameRun) -> StateLog:
        """What the run's lines are gathered in."""
        self._log = StateLog(run.run_id)
        return self._log

    def trajectory(self, log: RunLog, machine: Machine, scenario: Scenario) -> Trajectory:
        """The run's trajectory from its lines."""
        assert isinstance(log, StateLog)  # noqa: S101 - it is of `new_log`
        game, mod = self._settings.game, self._settings.mod
        return log.trajectory(machine, scenario, game=game, mod=mod)

    def read_log(self) -> str:
        """The lines since the last call; keys that are due are pressed or released."""
        now = self._game_time()
        while self._running and self._edges and self._edges[0][0] <= now + 1e-9:
            _, key, down = self._edges.pop(0)
            self._send(KEY, f"{key}_{'T' if down else 'F'}")
        lines = [self._first]
        self._first = ""
        while True:
            try:
                line = self._lines.get_nowait()
            except queue.Empty:
                break
            if line is None:
                self._lines.put(None)
                break
            lines.append(line)
        return "".join(lines)

    def _game_time(self) -> float:
        """The newest line's time, and what has passed since, until the next line is due."""
        newest_s = 0.0 if self._log is None else self._log.time_s
        if newest_s != self._newest_s:
            self._newest_s, self._newest_at = newest_s, time.monotonic()
        return newest_s + min(time.monotonic() - self._newest_at, INTERVAL_S)

    def stop(self) -> None:
        """Ends the simulation."""
        if self._running:
            self._send(FAIL, "")
            self._expect("SimulationEnd", "stop the simulation", self._limits.answer_s)
            self._running = False

    def clear(self) -> None:
        """Enters the level anew: nothing of the machine is left."""
        self._enter_level()
        self._traces.remove()

    def require_level(self, run: GameRun, log: RunLog) -> None:
        """The level was loaded by its path, and the game said so."""

    def recover(self) -> None:
        """Nothing can be in the way of a game without a window."""

    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_running()

    def restart(self) -> None:
        """Kills the game and starts it again."""
        self._start_anew()
        self._traces.remove()

    def screenshot(self) -> bytes | None:
        """There is no screen."""
        return None

    def close(self) -> None:
        """Ends the game."""
        self._end()
        self._traces.remove()
        self._lock.release()

    def _start_anew(self) -> None:
        self._end()
        port = _free_port(self._settings.port)
        words = [
            *command_words(self._settings.command),
            *("--ip", "127.0.0.1", "--port", str(port)),
        ]
        process = self._process.start(None, piped=True, words=words)
        self._lines = queue.SimpleQueue()
        assert process.stdout is not None  # noqa: S101 - it was piped
        self._reader = threading.Thread(
            target=_read_lines, args=(process.stdout, self._lines), daemon=True
        )
        self._reader.start()
        self._socket = _connected(port, process, self._limits.start_s)
        self._expect("MainMenuLoaded", "start the game", self._limits.start_s)
        self._send(SCENE, LEVEL_EDITOR)
        self._enter_level()

    def _enter_level(self) -> None:
        flat = level_file(Scenario.model_validate({"duration_s": 1.0}))
        self._send(LEVEL, str(self._process.level_file(self._level or flat)))
        self._expect("CustomLevelLoaded", "open the level", self._limits.answer_s)
        self._open_level = level_digest(self._level)
        self._running = False

    def _end(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._process.kill()
        if self._reader is not None:
            self._reader.join(timeout=5.0)
            self._reader = None
        self._running = False

    def _send(self, code: int, argument: str) -> None:
        text = f"{code} {argument}".encode()
        if self._socket is None:
            raise GameGoneError("the game is not connected")
        try:
            self._socket.sendall(len(text).to_bytes(4, "little") + text)
        except OSError as error:
            raise GameGoneError(f"the game does not listen any more: {error}") from error

    def _expect(self, message: str, step: str, timeout_s: float) -> str:
        """Waits for a message; lines before it are dropped: they belong to what came before."""
        ends = time.monotonic() + timeout_s
        while True:
            try:
                line = self._lines.get(timeout=max(0.01, ends - time.monotonic()))
            except queue.Empty as error:
                finding = f"the game did not say {message} within {timeout_s:.0f} s"
                raise StepFailedError(step, finding) from error
            if line is None:
                self._lines.put(None)
                raise GameGoneError(f"{step}: the game ended")
            if "BesiegeAgent" in line and "SendMessage:" in line and message in line:
                return line


def _read_lines(stream: IO[str], lines: queue.SimpleQueue[str | None]) -> None:
    for line in stream:
        lines.put(line)
    lines.put(None)


def _free_port(first: int) -> int:
    for port in range(first, min(first + PORTS, 65536)):
        with socket.socket() as trial:
            try:
                trial.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise GameGoneError(f"no port is free from {first} on")


def _connected(port: int, process: subprocess.Popen[str], limit_s: float) -> socket.socket:
    ends = time.monotonic() + limit_s
    while time.monotonic() < ends:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=5.0)
        except OSError as error:
            if process.poll() is not None:
                raise GameGoneError(f"the game ended with code {process.returncode}") from error
            time.sleep(0.1)
    raise GameGoneError(f"the game did not listen on port {port} within {limit_s:.0f} s")
