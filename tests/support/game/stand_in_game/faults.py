"""Faults on demand: what goes wrong, when, and how often."""

import json
from pathlib import Path
from typing import Final

from pydantic import BaseModel, Field

KINDS: Final = {"dialog": "open_folder", "clipboard_stolen": "copy", "lost_lines": "start"}
KINDS.update(dict.fromkeys(("freeze", "crash"), "simulating"))
"""Per kind: where it strikes when that is not told."""


class Fault(BaseModel):
    """One thing that goes wrong.

    Attributes:
        kind: what.
        at: the step at which it strikes, or "simulating".
        times: how often it will still strike; None forever.
        seconds: how long a freeze lasts; None forever.
    """

    kind: str = Field(alias="fault")
    at: str = ""
    times: int | None = 1
    seconds: float | None = None


class Faults:
    """The faults still to come."""

    def __init__(self, file: Path | None = None) -> None:
        listed = json.loads(file.read_text()) if file is not None and file.exists() else []
        self._faults = [Fault(**{"at": KINDS[entry["fault"]], **entry}) for entry in listed]

    def at(self, point: str) -> list[Fault]:
        """The faults that strike at a point now; each counts as done once more."""
        due = [fault for fault in self._faults if fault.at == point and fault.times != 0]
        for fault in due:
            if fault.times is not None:
                fault.times -= 1
        return due
