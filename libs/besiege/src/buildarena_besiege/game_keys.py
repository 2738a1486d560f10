"""The names of the game's keys: those of its engine's key codes, and its own of mouse buttons.

A machine of ours takes only the few in `buildarena_geometry.keys`; files of others use any.
"""

from __future__ import annotations

import re
from typing import Final

_KEY: Final = re.compile(
    r"""
    [A-Z] | Alpha\d | Keypad\d | F([1-9]|1[0-5]) | (Up|Down|Right|Left)Arrow
    | Keypad(Period|Divide|Multiply|Minus|Plus|Enter|Equals)
    | (Right|Left)(Shift|Control|Alt|Meta|Command|Apple|Windows|Paren|Bracket|Curly)
    | Backspace | Delete | Tab | Clear | Return | Pause | Escape | Space | Insert | Home | End
    | Page(Up|Down) | Numlock | CapsLock | ScrollLock | AltGr | Help | Print | SysReq | Break | Menu
    | Exclaim | DoubleQuote | Hash | Dollar | Percent | Ampersand | Quote | Asterisk | Plus | Comma
    | Minus | Period | Slash | Colon | Semicolon | Less | Equals | Greater | Question | At
    | Backslash | Caret | Underscore | BackQuote | Pipe | Tilde | None
    | M[0-6] | Mouse[0-6] | Joystick([1-9]|1[0-6])?Button1?\d
    """,
    re.ASCII | re.VERBOSE,
)


def is_game_key(name: str) -> bool:
    """Whether the game has a key, or a button of mouse or joystick, of this name."""
    return _KEY.fullmatch(name) is not None
