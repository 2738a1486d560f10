"""The clipboard, also when the program that owns it is frozen."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, Final, Protocol

from buildarena_simworker.besiege.errors import NotSetUpError, ScreenError

HAND_OVER_S: Final = 2.0
"""How long another program may take to hand over what it copied."""


TRIES: Final = 10
TRY_AGAIN_S: Final = 0.1
"""On Windows one program at a time has the clipboard; others, such as its history, soon let go."""


class Clipboard(Protocol):
    """Text that programs hand to each other; what cannot be reached raises `ScreenError`."""

    def put(self, text: str) -> None:
        """Puts a text there."""

    def get(self) -> str | None:
        """The text that is there; None if its owner does not hand it over."""

    def close(self) -> None:
        """Lets go of what was put there."""


def open_clipboard() -> Clipboard:
    """This machine's clipboard.

    Raises:
        NotSetUpError: There is no program to reach it.
    """
    return _SystemClipboard() if sys.platform == "win32" else _X11Clipboard()


class _SystemClipboard:
    """On Windows and macOS the system keeps the text itself."""

    def __init__(self) -> None:
        import pyperclip

        self._clip: Any = pyperclip

    def put(self, text: str) -> None:
        self._reached(lambda: self._clip.copy(text))

    def get(self) -> str | None:
        return str(self._reached(self._clip.paste))

    def close(self) -> None:
        pass

    def _reached(self, act: Callable[[], Any]) -> Any:
        for left in reversed(range(TRIES)):
            try:
                return act()
            except (self._clip.PyperclipException, OSError) as error:
                if not left:
                    raise ScreenError(
                        f"the clipboard cannot be reached, as another program keeps it: {error}"
                    ) from error
                time.sleep(TRY_AGAIN_S)
        return None


class _X11Clipboard:
    """On X11 a program that copied something hands it over itself, while it lives and answers."""

    def __init__(self) -> None:
        program = shutil.which("xclip")
        if program is None:
            raise NotSetUpError("the clipboard needs the program xclip: install it")
        self._words = [program, "-selection", "clipboard"]
        self._owner: subprocess.Popen[bytes] | None = None

    def put(self, text: str) -> None:
        self.close()
        self._owner = subprocess.Popen(
            [*self._words, "-quiet", "-in"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert self._owner.stdin is not None  # noqa: S101 - it was asked for
        try:
            self._owner.stdin.write(text.encode())
            self._owner.stdin.close()
        except OSError as error:
            raise ScreenError(f"the clipboard cannot be reached: {error}") from error

    def get(self) -> str | None:
        try:
            done = subprocess.run(
                [*self._words, "-out"], capture_output=True, timeout=HAND_OVER_S, check=False
            )
        except subprocess.TimeoutExpired:
            return None
        return done.stdout.decode("utf-8", "replace") if done.returncode == 0 else None

    def close(self) -> None:
        if self._owner is not None:
            self._owner.terminate()
            self._owner.wait()
            self._owner = None
