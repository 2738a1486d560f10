"""What files of evidence may be called, and how large they may be."""

from __future__ import annotations

import re
from typing import Final

DOCUMENT: Final = "evidence.json"
PAGE: Final = "report.html"
MEMBER: Final = re.compile(
    r"steps/([a-z0-9-]{1,40})/((?:machine|saved|log|script|picture)-[a-z0-9-]{1,40}\.(?:bsg|txt|lua|png))"
)
"""A step's file: its step and its name."""
MAX_BYTES: Final = 64 << 20
"""Of the whole file."""
MAX_MEMBERS: Final = 1000
MAX_MEMBER_BYTES: Final = 8 << 20
MAX_UNPACKED_BYTES: Final = 256 << 20
MAX_RATIO: Final = 200
"""How many times as large as its packed bytes a member may be; logs reach 20."""
SMALL_BYTES: Final = 64 << 10
"""Up to this size a member's ratio is not looked at."""
MAX_DOCUMENT_BYTES: Final = 2 << 20
PNG: Final = b"\x89PNG\r\n\x1a\n"
