"""Says whose a window is, as games do and tkinter does not."""

from __future__ import annotations

import os
import tkinter as tk


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
