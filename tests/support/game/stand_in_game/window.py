"""The game's window."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
import tkinter as tk
from collections.abc import Callable
from pathlib import Path
from typing import Final

from support.game.stand_in_game.faults import Fault
from support.game.stand_in_game.game import SIZE, Game
from support.game.stand_in_game.interface import Interface
from support.game.stand_in_game.panels import Shape, draw, shapes

TITLE: Final = "Besiege"
FRAMES_PER_S: Final = 30.0
_CONTROL: Final = 0x4
_CRASHED: Final = 139
"""The exit status a shell shows for a segmentation fault."""
_MODIFIERS: Final = ("Control", "Shift", "Alt", "Super", "Meta")


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


class Window:
    """The window with everything in it."""

    def __init__(self, game: Game, machines: Path, report: Report, *, title: bool = False) -> None:
        self._game, self._report = game, report
        self._root = tk.Tk(className="Besiege")
        self._root.title(TITLE)
        width, height = SIZE
        self._root.geometry(f"{width}x{height}+0+0")
        self._root.resizable(width=False, height=False)
        self._canvas = tk.Canvas(self._root, width=width, height=height, highlightthickness=0)
        self._canvas.pack()
        self._thieves: list[subprocess.Popen[bytes]] = []
        self._shown = Interface(game, machines, self, scene="title" if title else "level")
        self._drawn: list[Shape] = []
        self._modifiers: set[str] = set()
        self._pressed_on = ""
        self._last_s = time.monotonic()
        self._bind()

    def run(self) -> None:
        """Shows the window until it is closed."""
        # The report says that the game is there: clicks must reach it from then on.
        self._root.wait_visibility(self._canvas)
        sign(self._root)
        self._root.after(0, self._frame_due)
        try:
            self._root.mainloop()
        finally:
            for thief in self._thieves:
                thief.kill()
                thief.wait()

    def later(self, seconds: float, work: Callable[[], None]) -> None:
        """Does something after some time of the wall clock."""
        self._root.after(max(1, round(seconds * 1000)), work)

    def copy(self, text: str) -> None:
        """Puts a text into the clipboard."""
        self._root.clipboard_clear()
        self._root.clipboard_append(text)

    def strike(self, fault: Fault) -> None:
        """Carries out a fault that is the window's business."""
        # Whoever watches learns of it now or never.
        self._report.write(self._state())
        if fault.kind == "crash":
            os._exit(_CRASHED)
        elif fault.kind == "freeze":
            time.sleep(10_000 if fault.seconds is None else fault.seconds)
        elif fault.kind == "clipboard_stolen":
            # Right after the copy, before anybody reads it.
            self._root.after(30, self._steal)

    def _steal(self) -> None:
        command = [shutil.which("xclip") or "xclip", "-quiet", "-selection", "clipboard", "-i"]
        quiet = subprocess.DEVNULL
        thief = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)
        assert thief.stdin is not None
        thief.stdin.write(b"a text that somebody else has copied")
        thief.stdin.close()
        self._thieves.append(thief)

    def _bind(self) -> None:
        self._canvas.bind("<ButtonPress-1>", self._mouse_down)
        self._canvas.bind("<ButtonRelease-1>", self._mouse_up)
        self._root.bind("<KeyPress>", self._key_down)
        self._root.bind("<KeyRelease>", self._key_up)
        # Without a window manager nobody gives a new window the keyboard.
        self._root.bind("<Map>", lambda _: self._root.focus_force(), add=True)
        self._root.bind("<FocusOut>", lambda _: self._modifiers.clear(), add=True)
        self._root.protocol("WM_DELETE_WINDOW", self._root.destroy)

    def _fractions(self, event: tk.Event[tk.Misc]) -> tuple[float, float]:
        width, height = SIZE
        return event.x / width, event.y / height

    def _mouse_down(self, event: tk.Event[tk.Misc]) -> None:
        self._root.focus_force()
        self._pressed_on = self._shown.item_at(*self._fractions(event))

    def _mouse_up(self, event: tk.Event[tk.Misc]) -> None:
        item = self._shown.item_at(*self._fractions(event))
        if item == self._pressed_on:
            self._shown.click(item)
        self._pressed_on = ""

    def _key_down(self, event: tk.Event[tk.Misc]) -> None:
        state = event.state if isinstance(event.state, int) else 0
        name = event.keysym.removesuffix("_L").removesuffix("_R")
        if name in _MODIFIERS:
            self._modifiers.add(name)
        else:
            self._shown.key(event.keysym, event.char, control=bool(state & _CONTROL))

    def _key_up(self, event: tk.Event[tk.Misc]) -> None:
        self._modifiers.discard(event.keysym.removesuffix("_L").removesuffix("_R"))

    def _frame_due(self) -> None:
        now = time.monotonic()
        passed, self._last_s = now - self._last_s, now
        self._game.frame(passed)
        if self._game.simulating:
            for fault in self._game.faults.at("simulating") if self._game.time_s > 1 else ():
                self._shown.carry_out(fault)
        seen = shapes(self._shown)
        if seen != self._drawn:
            draw(self._canvas, seen)
            self._drawn = seen
        self._report.write(self._state())
        spent = time.monotonic() - now
        self._root.after(max(1, round((1 / FRAMES_PER_S - spent) * 1000)), self._frame_due)

    def _state(self) -> dict[str, object]:
        game, shown = self._game, self._shown
        held = sorted(self._modifiers)
        return {"phase": shown.phase, "machine": game.machine_name, "modifiers": held}


def sign(window: tk.Tk | tk.Toplevel) -> None:
    """Writes this process's number to a window that is shown."""
    from Xlib import Xatom, display

    screen = display.Display()
    try:
        inner = screen.create_resource_object("window", window.winfo_id())
        titled = inner.query_tree().parent
        number = screen.intern_atom("_NET_WM_PID")
        titled.change_property(number, Xatom.CARDINAL, 32, [os.getpid()])
        screen.sync()
    finally:
        screen.close()
