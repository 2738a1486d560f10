"""The check sum that ends every line of the log.

A script computes it in plain Lua arithmetic on doubles, so every step stays below 2**53 in Lua 5.1
to 5.5 alike.
"""

from __future__ import annotations

from typing import Final

FACTOR: Final = 257
MODULUS: Final = 2_147_483_647
"""Prime below 2**31, so that a sum fits the 32 bits of the mod's Lua."""


def checksum(text: str) -> int:
    """Return the sum of the characters of a line before the sum; of bytes for non-ASCII text."""
    total = 0
    for byte in text.encode("utf-8", "replace"):
        total = (total * FACTOR + byte + 1) % MODULUS
    return total
