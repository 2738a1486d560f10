"""Text that everything can hold: Postgres has no NUL, UTF-8 no lone surrogates."""

from __future__ import annotations

from typing import Any, Final

REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}"
INVISIBLE: Final = (
    r"\x00-\x1f\x7f\u0080-\u009f\u00ad\u061c\u180e"
    r"\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufffd"
)
"""Control, zero-width and bidirectional characters, for a character class: in a name they
would make it look like another, or like nothing. What replaces a broken character, as well."""


def clean(value: Any) -> Any:
    """Return a JSON value with U+FFFD in place of NUL and lone surrogates in its texts."""
    if isinstance(value, str):
        valid = value.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
        return valid.replace("\0", REPLACEMENT)
    if isinstance(value, dict):
        return {clean(key): clean(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [clean(entry) for entry in value]
    return value
