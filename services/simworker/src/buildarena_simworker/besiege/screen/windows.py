"""The game's window: found by its exact title and its program, on Windows, macOS and X11."""

from __future__ import annotations

import sys

from buildarena_simworker.besiege.screen.window_types import Wanted, Windows


def open_windows(wanted: Wanted) -> Windows:
    """The windows of this machine's screen.

    Args:
        wanted: What the game's window is known by.

    Raises:
        NotSetUpError: There is no screen.
    """
    if sys.platform in {"win32", "cygwin"}:
        from buildarena_simworker.besiege.screen.windows_win32 import Win32Windows

        return Win32Windows(wanted)
    from buildarena_simworker.besiege.screen.windows_x11 import X11Windows

    return X11Windows(wanted)
