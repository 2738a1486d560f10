"""Plays the stand-in game in its window: a screen, hands, and one game at a time."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from virtual_screen import virtual_screen

SUPPORT = Path(__file__).parent
SIZE = (1280, 800)
PLACE = (60, 40)
WAIT_S = 30.0
SPOTS = {
    "open folder": (0.202, 0.035),
    "name box": (0.476, 0.215),
    "open machine": (0.638, 0.209),
    "set ground": (0.403, 0.0185),
    "log window": (0.185, 0.172),
    "empty space": (0.034, 0.726),
    "start": (0.021, 0.016),
    "delete": (0.707, 0.038),
    "confirm": (0.538, 0.586),
    "dialog's OK": (0.5, 0.54),
}
"""Fractions of the window: the published ones, and those of the stand-in's own dialog."""


class Hands:
    """A player's hands at one display."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(SUPPORT / "stand_in_hands.py")],
            env={**os.environ, **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.do("hello")

    def do(self, *command: object) -> Any:
        """Carries out a command of `stand_in_hands`."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(command) + "\n")
        process.stdin.flush()
        ready, _, _ = select.select([process.stdout], [], [], WAIT_S)
        line = process.stdout.readline() if ready else ""
        assert line, f"the hands could not {command}"
        return json.loads(line)

    def close(self) -> None:
        """Ends the process; an xclip it left holds the pipe's other end until the screen goes."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()


class Game:
    """One running game.

    Attributes:
        process: the game's process.
    """

    def __init__(self, process: subprocess.Popen[str], hands: Hands, report: Path) -> None:
        self.process, self._hands, self._report = process, hands, report

    def report(self) -> dict[str, Any]:
        """What the game says it is doing; empty before it says anything."""
        if not self._report.exists():
            return {}
        found: dict[str, Any] = json.loads(self._report.read_text())
        return found

    def until(self, what: str, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Waits until the report fulfils a condition."""
        end = time.monotonic() + WAIT_S
        while True:
            report = self.report()
            if report and reached(report):
                return report
            assert self.process.poll() is None, f"the game has ended, waiting for: {what}"
            assert time.monotonic() < end, f"waited in vain for: {what}; {report}"
            time.sleep(0.01)

    def click(self, spot: str) -> None:
        """Clicks at a spot of the window."""
        (x, y), (left, top) = SPOTS[spot], PLACE
        self._hands.do("click", left + x * SIZE[0], top + y * SIZE[1])

    def press(self, *keys: str) -> None:
        """Presses one key, or several together."""
        self._hands.do("hotkey", *keys)

    def type(self, text: str) -> None:
        """Types a text."""
        self._hands.do("write", text)

    def load(self, name: str) -> None:
        """Loads a machine as a careful player does, and waits until it can be simulated."""
        self.click("open folder")
        self.until("load panel", lambda r: r["phase"] == "load panel")
        self.click("name box")
        self.press("ctrl", "a")
        self.press("backspace")
        self.type(name)
        self.until("the name", lambda r: r["name_box"] == name)
        self.click("open machine")
        self.until("machine", lambda r: r["machine"] == name and r["phase"] == "build")

    def start(self) -> None:
        """Starts the simulation, and waits until it runs."""
        self.until("a rollout", lambda r: r["rollout_ready"])
        self.click("start")
        self.until("simulation", lambda r: r["phase"] == "simulating")

    def put_on_clipboard(self, text: str) -> None:
        """Copies a text in another program; xclip takes a moment to own the clipboard."""
        self._hands.do("copy", text)
        end = time.monotonic() + WAIT_S
        while self._hands.do("copied") != text:
            assert time.monotonic() < end, "the clipboard does not take a text"
            time.sleep(0.01)

    def copy_log(self) -> list[str]:
        """What is in the clipboard after the log window was copied."""
        copies = self.report()["counts"]["copies"]
        self.click("log window")
        self.press("ctrl", "a")
        self.press("ctrl", "c")
        self.until("a copy", lambda r: r["counts"]["copies"] == copies + 1)
        return str(self._hands.do("copied")).split("\n")


class Table:
    """A screen with hands, at which games are played one after the other.

    Attributes:
        hands: the player's hands.
        environment: what programs on the screen need.
    """

    def __init__(self, environment: dict[str, str]) -> None:
        self.environment, self.hands = environment, Hands(environment)

    @contextmanager
    def game(self, folder: Path, *options: str, faults: Sequence[object] = ()) -> Iterator[Game]:
        """A game with its machines in a folder, and a report beside them."""
        report = folder / "report.json"
        listed = folder / "faults.json"
        listed.write_text(json.dumps(list(faults)))
        process = start_game(
            *("--machines", str(folder), "--report", str(report), "--faults", str(listed)),
            *("--place", f"{PLACE[0]},{PLACE[1]}", "--speed", "20", "--horizon", "4"),
            *options,
            environment=self.environment,
        )
        try:
            game = Game(process, self.hands, report)
            game.until("the window", lambda _: True)
            yield game
        finally:
            process.kill()
            process.communicate()


def start_game(*options: str, environment: Mapping[str, str]) -> subprocess.Popen[str]:
    """A process that runs the stand-in game."""
    paths = os.pathsep.join([str(SUPPORT), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-m", "stand_in_game", *options],
        env={**os.environ, **environment, "PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@contextmanager
def laid_table() -> Iterator[Table]:
    """A table on a screen of its own."""
    with virtual_screen() as environment:
        table = Table(environment)
        try:
            yield table
        finally:
            table.hands.close()
