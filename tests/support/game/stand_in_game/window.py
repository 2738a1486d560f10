"""The game's window."""

from __future__ import annotations

import contextlib
import time
import tkinter as tk
from collections.abc import Callable
from pathlib import Path
from typing import Final

from support.game.stand_in_game.breakage import Breakage
from support.game.stand_in_game.faults import Fault
from support.game.stand_in_game.game import Game
from support.game.stand_in_game.interface import Interface
from support.game.stand_in_game.ownership import sign
from support.game.stand_in_game.panels import Shape, draw, shapes
from support.game.stand_in_game.report import Report

TITLE: Final = "Besiege"
SIZE: Final = (1280, 800)
"""Width and height, pixels."""
FRAMES_PER_S: Final = 30.0
_CONTROL: Final = 0x4
_LOCK: Final = 0x2
_MODIFIERS: Final = ("Control", "Shift", "Alt", "Super", "Meta")


class Window:
    """The window with everything in it."""

    def __init__(self, game: Game, machines: Path, report: Report, *, title: bool = False) -> None:
        self._game, self._report, self._size = game, report, SIZE
        self._root = tk.Tk(className="Besiege")
        self._root.title(TITLE)
        width, height = SIZE
        self._root.geometry(f"{width}x{height}+0+0")
        self._root.resizable(width=False, height=False)
        self._canvas = tk.Canvas(self._root, width=width, height=height, highlightthickness=0)
        self._canvas.pack()
        self._breakage = Breakage(self._root)
        self._shown = Interface(game, machines, self, scene="title" if title else "level")
        self._drawn: list[Shape] = []
        self._modifiers: set[str] = set()
        self._caps_lock = False
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
            self._breakage.close()

    def later(self, seconds: float, work: Callable[[], None]) -> None:
        """Does something after some time of the wall clock."""
        self._root.after(max(1, round(seconds * 1000)), work)

    def copy(self, text: str) -> None:
        """Puts a text into the clipboard."""
        self._root.clipboard_clear()
        self._root.clipboard_append(text)

    def paste(self) -> str:
        """The clipboard's text; "" if nobody has any."""
        with contextlib.suppress(tk.TclError):
            return str(self._root.clipboard_get())
        return ""

    def strike(self, fault: Fault) -> None:
        """Carries out a fault that is the window's business."""
        if fault.kind in ("freeze", "crash"):
            # Whoever watches learns of it now or never.
            self._report.write(self._state())
        if fault.kind == "resize":
            self._resize((round(fault.number("width", 1100)), round(fault.number("height", 700))))
        self._breakage.strike(fault)

    def _resize(self, size: tuple[int, int]) -> None:
        """The window as somebody dragged it; what lies in it moves along, all but the mod's."""
        width, height = self._size = self._shown.size = self._game.screen = size
        self._root.geometry(f"{width}x{height}+0+0")
        self._canvas.config(width=width, height=height)
        self._drawn = []

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
        width, height = self._size
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
        self._caps_lock = bool(state & _LOCK)
        name = event.keysym.removesuffix("_L").removesuffix("_R")
        if name in _MODIFIERS:
            self._modifiers.add(name)
        elif name == "Caps_Lock":
            self._caps_lock = not self._caps_lock
        else:
            self._shown.key(event.keysym, event.char, control=bool(state & _CONTROL))

    def _key_up(self, event: tk.Event[tk.Misc]) -> None:
        self._modifiers.discard(event.keysym.removesuffix("_L").removesuffix("_R"))

    def _frame_due(self) -> None:
        now = time.monotonic()
        passed, self._last_s = now - self._last_s, now
        self._game.frame(passed)
        if self._game.simulating:
            for fault in self._game.faults.at("simulating", self._game.time_s):
                self._shown.carry_out(fault)
        seen = shapes(self._shown)
        if seen != self._drawn:
            draw(self._canvas, self._size, seen)
            self._drawn = seen
        self._report.write(self._state())
        spent = time.monotonic() - now
        self._root.after(max(1, round((1 / FRAMES_PER_S - spent) * 1000)), self._frame_due)

    def _state(self) -> dict[str, object]:
        game, shown = self._game, self._shown
        return {
            "phase": shown.phase,
            "machine": game.machine_name,
            "message": game.message,
            "modifiers": sorted(self._modifiers),
            "caps_lock": self._caps_lock,
            "counts": dict(game.counts),
            "faults": list(game.faults.struck),
        }
