"""Tags of MJCF text; every number is written in full."""

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np


def tag(element: str, /, **attributes: object) -> str:
    """Return an element without content."""
    return f"<{element}{_written(attributes)}/>"


def opened(element: str, /, **attributes: object) -> str:
    """Return the start tag of an element."""
    return f"<{element}{_written(attributes)}>"


def _written(attributes: Mapping[str, object]) -> str:
    return "".join(f" {key}={quoteattr(_text(value))}" for key, value in attributes.items())


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return " ".join(repr(float(number)) for number in np.atleast_1d(np.asarray(value)))
