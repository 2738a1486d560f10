"""The game's window: found by its exact title and its program, on Windows, macOS and X11."""

from __future__ import annotations

import sys

from buildarena_simworker.besiege.screen.window_types import WindowIdentity, Windows


def open_windows(identity: WindowIdentity) -> Windows:
    """Return the windows of this machine's screen.

    Raises:
        NotSetUpError: The screen is missing.
    """
    if sys.platform in {"win32", "cygwin"}:
        from buildarena_simworker.besiege.screen.windows_win32 import Win32Windows

        return Win32Windows(identity)
    from buildarena_simworker.besiege.screen.windows_x11 import X11Windows

    return X11Windows(identity)
