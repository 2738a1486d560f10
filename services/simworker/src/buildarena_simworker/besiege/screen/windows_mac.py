"""The game's window on macOS, by System Events; the terminal needs the right to control it."""

from __future__ import annotations

import subprocess

from buildarena_simworker.besiege.errors import ScreenError
from buildarena_simworker.besiege.screen.window_types import Area, Wanted

ANSWER_S = 5.0


class MacWindows:
    """Finds a process by the program's name; a window's area is with its title bar."""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted = wanted

    def find(self) -> Area | None:
        """Where the process's first window is."""
        text = self._asked("get {position, size} of (first window of it)")
        parts = [part.strip() for part in text.replace("{", "").replace("}", "").split(",")]
        if len(parts) != 4:  # noqa: PLR2004 - position and size
            return None
        return Area(*(int(part) for part in parts))

    def raise_(self) -> None:
        """Brings the process to the front."""
        self._asked("set frontmost to true")

    def is_active(self) -> bool:
        """Whether the process is in front."""
        return self._asked("get frontmost") == "true"

    def process(self) -> int | None:
        """The process's number."""
        number = self._asked("get unix id")
        return int(number) if number.isdigit() else None

    def _asked(self, what: str) -> str:
        known = self.wanted.executable or self.wanted.title
        name = "".join(letter for letter in known if letter.isalnum() or letter in " -()_.")
        process = f'tell application "System Events" to tell (first process whose name is "{name}")'
        try:
            done = subprocess.run(
                ["/usr/bin/osascript", "-e", f"{process} to {what}"],
                capture_output=True,
                text=True,
                timeout=ANSWER_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ScreenError(f"System Events does not answer: {error}") from error
        return done.stdout.strip()
