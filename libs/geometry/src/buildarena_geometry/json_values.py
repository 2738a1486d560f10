"""Values as JSON: copies that can be written wherever a machine is stored, and their levels."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

LARGEST_INTEGER = 2**63 - 1  # databases and other languages read no larger one back
MAX_CONTROLLER_BYTES = 64 * 1024
_LONGEST_TEXT = 2_000  # characters of what is refused; what is accepted is kept whole
_DEEPEST = 8  # levels of lists and objects inside one another
_UNSTORABLE = re.compile("[\x00\ud800-\udfff]")
_WIDEST = 200  # entries of a list or object


def is_storable(text: str) -> bool:
    """Whether every database takes the text: without NUL characters and lone surrogates."""
    return _UNSTORABLE.search(text) is None


def check_controller(program: str) -> None:
    """Checks the text of a controller's program; whether it can be run is not asked.

    Raises:
        ValueError: It is too long, or no text that can be stored.
    """
    if not is_storable(program):
        raise ValueError("expected a text without NUL characters and lone surrogates")
    size = len(program.encode())
    if size > MAX_CONTROLLER_BYTES:
        raise ValueError(f"expected at most {MAX_CONTROLLER_BYTES:,} bytes, found {size:,}")


def levels(value: object) -> Iterator[list[object]]:
    """A JSON value level by level: itself, then what it holds, then what that holds, and so on.

    A level is collected only when it is asked for, so a caller that stops reads no deeper.

    Args:
        value: JSON as Python has it: objects are dicts, arrays lists or tuples.
    """
    level = [value]
    while level:
        yield level
        inner: list[object] = []
        for entry in level:
            if isinstance(entry, dict):
                inner += entry.values()
            elif isinstance(entry, list | tuple):
                inner += entry
        level = inner


def json_value(value: object, *, depth: int = 0, longest: int = _LONGEST_TEXT) -> object:
    """The value as JSON, with {"unreadable": …} in place of what is none or is too large to keep.

    Args:
        value: anything at all.
        depth: how many lists and objects it lies inside.
        longest: characters of a text that is kept.
    """
    if isinstance(value, str):
        return _text(value, longest)
    if value is None or isinstance(value, bool | int | float):
        return _number(value)
    if depth < _DEEPEST and isinstance(value, Mapping | list | tuple) and len(value) <= _WIDEST:
        return _container(value, depth + 1, longest)
    return _unreadable(type(value).__name__)


def _text(text: str, longest: int = _LONGEST_TEXT) -> object:
    if len(text) > longest or not is_storable(text):
        return _unreadable(f"text of {len(text)} characters")
    return str(text)


def _number(number: bool | float | None) -> object:
    if isinstance(number, float):
        return float(number) if math.isfinite(number) else _unreadable(str(float(number)))
    if isinstance(number, int) and abs(number) > LARGEST_INTEGER:
        return _unreadable("huge number")
    return number


def _container(value: Any, depth: int, longest: int) -> object:
    if not isinstance(value, Mapping):
        return [json_value(entry, depth=depth, longest=longest) for entry in value]
    entries: dict[str, object] = {}
    for key, entry in value.items():
        if not isinstance(key, str) or not isinstance(_text(key), str):
            return _unreadable("object with unreadable keys")
        entries[str(key)] = json_value(entry, depth=depth, longest=longest)
    return entries


def _unreadable(what: str) -> dict[str, str]:
    return {"unreadable": what}
