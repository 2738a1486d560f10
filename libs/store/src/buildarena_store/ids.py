"""Identifiers and content hashes."""

from __future__ import annotations

import hashlib
import json
import secrets
from typing import Any


def canonical_json(value: Any) -> str:
    """One spelling per value: sorted keys, no spaces; equal values give equal texts."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def content_hash(value: Any) -> str:
    """The SHA-256 of a JSON value's canonical spelling, as 64 hex digits."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def new_id(prefix: str) -> str:
    """A new identifier, ``prefix_`` and 80 random bits: short to read, never met twice."""
    return f"{prefix}_{secrets.token_hex(10)}"
