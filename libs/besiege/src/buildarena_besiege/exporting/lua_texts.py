"""Texts as Lua."""

from __future__ import annotations

import string
from typing import Final

_PLAIN: Final = frozenset((string.ascii_letters + string.digits + "_-.,:% ").encode())


def lua_text(text: str) -> str:
    """Quote any text as a Lua string."""
    safe = "".join(
        chr(byte) if byte in _PLAIN else f"\\{byte:03d}" for byte in text.encode("utf-8", "replace")
    )
    return f'"{safe}"'
