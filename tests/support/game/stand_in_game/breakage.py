"""The faults that strike the window or the process around it."""

from __future__ import annotations

import shutil
import subprocess
import tkinter as tk
from typing import Final

from support.game.stand_in_game.faults import Fault
from support.game.stand_in_game.stopping import crash, freeze

_SOON_MS: Final = 30
"""After this a stolen clipboard is another's: right after the copy, before anybody reads it."""


class Breakage:
    """Carries out faults."""

    def __init__(self, root: tk.Tk) -> None:
        self._root = root
        self._thieves: list[subprocess.Popen[bytes]] = []

    def strike(self, fault: Fault) -> None:
        """Carries out a fault; those that are the game's own business pass."""
        if fault.kind == "freeze":
            freeze(fault)
        elif fault.kind == "crash":
            crash()
        elif fault.kind == "lost_focus":
            self._another_window(fault)
        elif fault.kind == "caps_lock":
            press_caps_lock()
        elif fault.kind == "clipboard_stolen":
            text = fault.text("a text that somebody else has copied")
            self._root.after(_SOON_MS, lambda: self._steal(text))

    def close(self) -> None:
        """Ends what it started."""
        for thief in self._thieves:
            thief.kill()
            thief.wait()

    def _steal(self, text: str) -> None:
        command = [shutil.which("xclip") or "xclip", "-quiet", "-selection", "clipboard", "-i"]
        thief = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert thief.stdin is not None
        thief.stdin.write(text.encode())
        thief.stdin.close()
        self._thieves.append(thief)

    def _another_window(self, fault: Fault) -> None:
        other = tk.Toplevel(self._root)
        other.title("Messages")
        left, top = self._root.winfo_rootx(), self._root.winfo_rooty()
        width, height = self._root.winfo_width(), self._root.winfo_height()
        if fault.options.get("covers") is True:
            other.geometry(f"{width}x{height}+{left}+{top}")
        else:
            other.geometry(f"300x160+{left + width - 320}+{top + height - 180}")
        tk.Label(other, text="A message from somebody").pack(expand=True)
        # Keys that arrive here are lost to the game: they must not reach its bindings.
        other.bindtags((str(other), "all"))
        other.lift()
        other.focus_force()
        self._root.after(round(fault.number("seconds", 3.0) * 1000), other.destroy)


def press_caps_lock() -> None:
    """Presses caps lock on the real keyboard of the display."""
    from Xlib import XK, X, display
    from Xlib.ext import xtest

    screen = display.Display()
    try:
        key = screen.keysym_to_keycode(XK.XK_Caps_Lock)
        for event in (X.KeyPress, X.KeyRelease):
            xtest.fake_input(screen, event, key)
        screen.sync()
    finally:
        screen.close()
