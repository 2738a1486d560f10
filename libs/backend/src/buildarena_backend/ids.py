"""Identifiers and content hashes."""

from __future__ import annotations

import hashlib
import json
import secrets
from typing import Any

from sqlalchemy import ColumnElement, and_


def canonical_json(value: Any) -> str:
    """Return one spelling per value: sorted keys, no spaces; equal values give equal texts."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def content_hash(value: Any) -> str:
    """Return the SHA-256 of a JSON value's canonical spelling, as 64 hex digits."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def new_id(prefix: str) -> str:
    """Return a new identifier, ``prefix_`` and 80 random bits: short to read, never met twice."""
    return f"{prefix}_{secrets.token_hex(10)}"


def begins_with(column: ColumnElement[str], prefix: str) -> ColumnElement[bool]:
    """Return the condition that an id begins with a prefix: a range, which the key's index serves.

    Ids go on in hexadecimal digits, which every collation sorts before "g".

    Args:
        prefix: ``kind_`` and some hexadecimal digits.
    """
    return and_(column >= prefix, column < prefix + "g", column.startswith(prefix, autoescape=True))
