"""The game without a window, as the plugin of BesiegeField drives it over TCP.

Commands are frames: four bytes of length, little-endian, then "<code> <argument>" in UTF-8. Answers
are lines on standard output, "[Info   :BesiegeAgent] SendMessage: <message>". A frame that is no
command is told on standard output too and otherwise passed over, as are commands at a wrong time.
"""

import os
import selectors
import socket
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from stand_in_game.faults import Fault
from stand_in_game.game import Game
from stand_in_game.report import Report
from stand_in_game.stopping import crash, freeze

_FRAME_S: Final = 0.02
_STATE_EVERY_S: Final = 0.2
_LONGEST_FRAME: Final = 65_536
_SCENES: Final = {
    "0": "BlackScreenLoaded",
    "1": "MainMenuLoaded",
    "2": "LevelSelectLoaded",
    "3": "BuildingSceneLoaded",
}


class Headless:
    """The server and the game's loop, in one thread."""

    def __init__(self, game: Game, report: Report, *, ip: str, port: int) -> None:
        self._game, self._report = game, report
        self._server = socket.create_server((ip, port))
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._server, selectors.EVENT_READ)
        self._client: socket.socket | None = None
        self._received = b""
        self._told = 0
        self._commands: dict[str, Callable[[str], None]] = {
            "0": self._scene,
            "2": self._load_machine,
            "3": self._toggle,
            "4": self._key,
            "5": self._load_level,
            "6": self._fail,
        }

    def run(self) -> int:
        """Serves until standard output is closed or the process is ended."""
        port = self._server.getsockname()[1]
        self._say("GameLaunched")
        self._line(f"TCP listening on port {port}")
        self._line("TCP initalized")
        self._say("MainMenuLoaded")
        last = time.monotonic()
        try:
            while True:
                self._listen(_FRAME_S)
                now = time.monotonic()
                self._frame(now - last)
                last = now
        except BrokenPipeError:
            # Nobody reads any more; the interpreter's own flush must not complain about it.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0

    def _listen(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            for key, _ in self._selector.select(left):
                if key.fileobj is self._server:
                    self._accept()
                else:
                    self._receive()

    def _accept(self) -> None:
        self._drop()
        self._client, _ = self._server.accept()
        self._selector.register(self._client, selectors.EVENT_READ)

    def _drop(self) -> None:
        if self._client is not None:
            self._selector.unregister(self._client)
            self._client.close()
        self._client, self._received = None, b""

    def _receive(self) -> None:
        assert self._client is not None
        try:
            part = self._client.recv(4096)
        except ConnectionError:
            part = b""
        if not part:
            self._drop()
            return
        self._received += part
        while len(self._received) >= 4:
            (length,) = struct.unpack("<I", self._received[:4])
            if length > _LONGEST_FRAME:
                self._line(f"a frame of {length} bytes is too long; connection closed")
                self._drop()
                return
            if len(self._received) < 4 + length:
                return
            frame, self._received = self._received[4 : 4 + length], self._received[4 + length :]
            self._command(frame)

    def _command(self, frame: bytes) -> None:
        code, _, argument = frame.decode(errors="replace").partition(" ")
        command = self._commands.get(code)
        if command is None:
            self._line(f"unknown command {code!r}; known: {', '.join(self._commands)}")
            return
        command(argument.strip())

    def _scene(self, number: str) -> None:
        if number in _SCENES:
            self._say(_SCENES[number])
        else:
            self._line(f"unknown scene {number!r}; known: {', '.join(_SCENES)}")

    def _load_level(self, path: str) -> None:
        try:
            Path(path).read_bytes()
        except OSError as error:
            self._line(f"could not load the level {path}: {error}")
            return
        self._say("CustomLevelLoaded")

    def _load_machine(self, path: str) -> None:
        self._end()
        for fault in self._strike(self._game.faults.at("open_machine")):
            if fault.kind == "slow_load":
                time.sleep(fault.number("seconds", 5.0))
        if self._game.load(Path(path)):
            self._say("MachineLoaded")
        else:
            self._line(self._game.message)

    def _toggle(self, _: str) -> None:
        if self._game.simulating:
            self._strike(self._game.faults.at("stop"))
            self._end()
            return
        if self._game.run is None:
            self._line("there is no machine to simulate")
            return
        self._strike(self._game.start())
        self._told = 0
        self._say("SimulationStart")

    def _key(self, argument: str) -> None:
        name, _, way = argument.rpartition("_")
        if not name or way not in ("T", "F"):
            self._line(f"a key is <name>_T or <name>_F, not {argument!r}")
            return
        self._say("PressKey")

    def _fail(self, _: str) -> None:
        if self._game.simulating:
            self._say("LevelFail")
            self._end()

    def _end(self) -> None:
        if self._game.simulating:
            self._game.stop()
            self._say("SimulationEnd")

    def _frame(self, passed_s: float) -> None:
        game = self._game
        game.frame(passed_s)
        if game.simulating and game.run is not None:
            self._strike(game.faults.at("simulating", game.time_s))
            due = int(game.time_s / _STATE_EVERY_S + 1e-6) + 1
            for state in game.run.states[self._told : due]:
                self._say(state)
            self._told = due
        self._report.write(
            {
                "phase": "simulating" if game.simulating else "build",
                "machine": game.machine_name,
                "message": game.message,
                "counts": dict(game.counts),
                "faults": list(game.faults.struck),
            }
        )

    def _strike(self, faults: list[Fault]) -> list[Fault]:
        for fault in faults:
            if fault.kind == "freeze":
                freeze(fault)
            elif fault.kind == "crash":
                crash()
        return faults

    def _say(self, message: str) -> None:
        self._line(f"SendMessage: {message}")

    def _line(self, text: str) -> None:
        sys.stdout.write(f"[Info   :BesiegeAgent] {text}\n")
        sys.stdout.flush()
