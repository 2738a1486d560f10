"""Values as JSON: copies that can be written wherever a machine is stored."""

import math
import re
from collections.abc import Mapping
from functools import partial
from typing import Any

LARGEST_INTEGER = 2**63 - 1  # databases and other languages cannot read a larger one
MAX_CONTROLLER_BYTES = 64 * 1024
_LONGEST_TEXT = 2_000  # characters of a refused text; an accepted one is kept complete
_DEEPEST = 8  # levels of lists and objects inside one another
_UNSTORABLE = re.compile("[\x00\ud800-\udfff]")
_WIDEST = 200  # entries of a list or object


def is_storable(text: str) -> bool:
    """Check if every database accepts the text: it has no NUL characters or lone surrogates."""
    return _UNSTORABLE.search(text) is None


def check_controller(program: str) -> None:
    """Check the text of a controller's program, without checking if it can be run.

    Raises:
        ValueError: It is too long or cannot be stored.
    """
    if not is_storable(program):
        raise ValueError("expected a text without NUL characters and lone surrogates")
    size = len(program.encode())
    if size > MAX_CONTROLLER_BYTES:
        raise ValueError(f"expected at most {MAX_CONTROLLER_BYTES:,} bytes, found {size:,}")


def json_value(value: Any, *, depth: int = 0, longest: int = _LONGEST_TEXT) -> object:
    """Return the value as JSON, with {"unreadable": …} for values that are not JSON or too large.

    Args:
        value: any object.
        depth: number of lists and objects around it.
        longest: longest text that is kept, characters.
    """
    if isinstance(value, str):
        return _text(value, longest)
    if value is None or isinstance(value, int | float):
        return _number(value)
    is_container = isinstance(value, Mapping | list | tuple)
    if depth == _DEEPEST or not is_container or len(value) > _WIDEST:
        return _unreadable(type(value).__name__)
    within = partial(json_value, depth=depth + 1, longest=longest)
    if not isinstance(value, Mapping):
        return [within(entry) for entry in value]
    if not all(isinstance(key, str) and isinstance(_text(key), str) for key in value):
        return _unreadable("object with unreadable keys")
    return {str(key): within(entry) for key, entry in value.items()}


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


def _unreadable(content: str) -> dict[str, str]:
    return {"unreadable": content}
