"""The runbook's entries."""

import re
from pathlib import Path

RUNBOOK = Path(__file__).resolve().parents[3] / "docs" / "runbook.md"
PARTS = ("Means", "Look", "Do")


def entries() -> dict[str, str]:
    """The runbook's entries by alert."""
    parts = re.split(r"^## (\S+)\n", RUNBOOK.read_text(), flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def entry(alert: str) -> dict[str, str]:
    """An entry's parts by name."""
    parts = re.split(rf"^\*\*({'|'.join(PARTS)})\*\*: ", entries()[alert], flags=re.MULTILINE)[1:]
    assert tuple(parts[::2]) == PARTS, alert
    return dict(zip(parts[::2], parts[1::2], strict=True))
