"""Faults on demand: what goes wrong, when, and how often."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

POINTS: Final = (
    "open_folder",
    "name_box",
    "open_machine",
    "set_ground",
    "lua_panel",
    "start",
    "simulating",
    "log_window",
    "copy",
    "stop",
    "delete",
    "confirm",
)
"""Where a fault can strike: at the step of that name, or some time into a simulation."""

KINDS: Final = {
    "slow_load": "open_machine",
    "dialog": "open_folder",
    "lost_focus": "open_machine",
    "freeze": "simulating",
    "crash": "simulating",
    "caps_lock": "open_folder",
    "clipboard_stolen": "copy",
    "lua_error": "start",
    "cut_lines": "start",
    "repeat_lines": "start",
    "lost_lines": "start",
    "lag": "start",
    "log_scrolled": "copy",
    "resize": "open_folder",
}
"""Per kind: where it strikes when that is not told."""
MOVABLE: Final = {"dialog", "lost_focus", "freeze", "crash", "caps_lock", "resize"}
"""Those that may strike elsewhere, too."""


@dataclass(slots=True, kw_only=True)
class Fault:
    """One thing that goes wrong.

    Attributes:
        kind: what.
        at: the point where.
        left: how often it will still strike; None forever.
        options: what else was told.
    """

    kind: str
    at: str
    left: int | None = 1
    options: Mapping[str, object] = field(default_factory=dict)

    def number(self, name: str, default: float) -> float:
        """A number among the options."""
        value = self.options.get(name, default)
        return float(value) if isinstance(value, int | float) else default

    def text(self, default: str) -> str:
        """The option "text"."""
        return str(self.options.get("text", default))

    @property
    def for_ever(self) -> bool:
        """Whether a freeze has no end: its seconds are null or left out."""
        return self.options.get("seconds") is None


class Faults:
    """The faults still to come."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults = list(faults)
        self.struck: list[str] = []

    def at(self, point: str, time_s: float | None = None) -> list[Fault]:
        """The faults that strike at a point now; each counts as done once more.

        Args:
            point: one of `POINTS`.
            time_s: game time since the start, for the point "simulating".
        """
        due = []
        for fault in self._faults:
            if fault.at != point or fault.left == 0:
                continue
            if time_s is not None and time_s < fault.number("after_s", 1.0):
                continue
            if fault.left is not None:
                fault.left -= 1
            due.append(fault)
            self.struck.append(f"{fault.kind} at {point}")
        return due


def read_faults(path: Path) -> list[Fault]:
    """The faults of a file: a JSON list of objects with "fault" and what else is told."""
    return [
        Fault(
            kind=entry["fault"],
            at=entry.get("at", KINDS[entry["fault"]]),
            left=entry.get("times", 1),
            options=entry,
        )
        for entry in json.loads(path.read_text())
    ]
