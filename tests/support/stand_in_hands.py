"""Mouse, keyboard and clipboard of one display: pyautogui binds a process to a display for good.

Reads commands as JSON lists, one a line, and answers each with one line of JSON.
"""

from __future__ import annotations

import contextlib
import json
import sys

# python-xlib warns on standard output, where our answers go.
with contextlib.redirect_stdout(sys.stderr):
    import pyautogui
import pyperclip
from PIL import ImageGrab

pyautogui.PAUSE = 0.01
pyautogui.FAILSAFE = False


def main() -> None:
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        sys.stdout.write(json.dumps(_COMMANDS[name](*arguments)) + "\n")
        sys.stdout.flush()


def _grab(path: str) -> None:
    ImageGrab.grab().save(path)


_COMMANDS = {
    "click": pyautogui.click,
    "down": pyautogui.keyDown,
    "up": pyautogui.keyUp,
    "press": pyautogui.press,
    "hotkey": pyautogui.hotkey,
    "write": pyautogui.write,
    "copied": pyperclip.paste,
    "copy": pyperclip.copy,
    "grab": _grab,
    "hello": lambda: None,
}

if __name__ == "__main__":
    main()
