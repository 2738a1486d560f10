"""Untrusted JSON, read and written with a limit on its nesting depth.

Python's reader goes as deep as its stack does. Whatever runs there, such as the end of an object
that the garbage collector finds, fails for want of room; so the depth is checked first.
"""

import json
import re
from typing import Any

MAX_DEPTH = 64
"""Nested arrays and objects; valid input has less than twenty."""
_STRINGS = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*"', re.DOTALL)
_BRACES_TO_BRACKETS = bytes.maketrans(b"{}", b"[]")
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


class TooDeepError(ValueError):
    """A JSON text has more arrays and objects inside each other than are read."""


def read_json(text: str | bytes, max_depth: int = MAX_DEPTH) -> Any:
    """Parse a JSON text.

    Raises:
        TooDeepError: It nests deeper than `max_depth`.
        ValueError: It is not JSON, or not UTF-8.
    """
    data = text.encode(errors="surrogatepass") if isinstance(text, str) else text
    if is_too_deep(data, max_depth):
        raise _too_deep(max_depth)
    return json.loads(text)


def write_json(value: Any, max_depth: int = MAX_DEPTH) -> str:
    """Return a value as JSON, in ASCII and without spaces.

    Raises:
        TooDeepError: It nests deeper than `max_depth`.
        TypeError: It is not JSON.
        ValueError: It contains a number that is not finite.
    """
    try:
        text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    except RecursionError:
        raise _too_deep(max_depth) from None
    if is_too_deep(text.encode(), max_depth):
        raise _too_deep(max_depth)
    return text


def _too_deep(max_depth: int) -> TooDeepError:
    return TooDeepError(f"more than {max_depth} arrays or objects inside each other")


def is_too_deep(body: bytes, max_depth: int = MAX_DEPTH) -> bool:
    """Check if a JSON text nests arrays and objects deeper than `max_depth`.

    A text that is not JSON may be taken for too deep; it would be refused anyway.
    """
    if body.count(b"[") + body.count(b"{") <= max_depth:
        return False
    brackets = _STRINGS.sub(b"", body).translate(_BRACES_TO_BRACKETS, _NO_BRACKETS)
    # Each round removes the innermost level.
    for _ in range(max_depth):
        if not brackets:
            return False
        brackets = brackets.replace(b"[]", b"")
    return bool(brackets)
