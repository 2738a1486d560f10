"""JSON texts that strangers write: read with a bound on how deep they nest.

Python's reader goes as deep as its stack does. Whatever runs there, such as the end of an object
that the garbage collector finds, fails for want of room; so the depth is looked at before.
"""

import json
import re
from typing import Any

MAX_DEPTH = 64
"""Arrays and objects inside each other: what is read of strangers has less than twenty."""
_STRINGS = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*"', re.DOTALL)
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


class TooDeepError(ValueError):
    """A JSON text has more arrays and objects inside each other than are read."""


def read_json(text: str | bytes, max_depth: int = MAX_DEPTH) -> Any:
    """The value that a JSON text spells.

    Raises:
        TooDeepError: It nests deeper than that.
        ValueError: It is not JSON, or not UTF-8.
    """
    data = text.encode(errors="surrogatepass") if isinstance(text, str) else text
    if is_too_deep(data, max_depth):
        raise TooDeepError(f"more than {max_depth} arrays or objects inside each other")
    return json.loads(text)


def is_too_deep(body: bytes, max_depth: int = MAX_DEPTH) -> bool:
    """Whether a JSON text has more arrays and objects inside each other than that.

    A text that is not JSON may be taken for too deep; it would be refused anyway.
    """
    if body.count(b"[") + body.count(b"{") <= max_depth:
        return False
    rest = _STRINGS.sub(b"", body).translate(None, _NO_BRACKETS)
    # Each round removes the innermost level.
    for _ in range(max_depth):
        if not rest:
            return False
        rest = rest.replace(b"[]", b"").replace(b"{}", b"")
    return bool(rest)
