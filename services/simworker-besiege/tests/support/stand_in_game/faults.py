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

KINDS: Final[Mapping[str, tuple[str, tuple[str, ...]]]] = {
    "slow_load": ("open_machine", ("seconds",)),
    "dialog": ("open_folder", ("text",)),
    "lost_focus": ("open_machine", ("seconds", "covers")),
    "freeze": ("simulating", ("seconds", "after_s")),
    "crash": ("simulating", ("after_s",)),
    "caps_lock": ("open_folder", ()),
    "clipboard_stolen": ("copy", ("text",)),
    "lua_error": ("start", ("update", "text")),
    "cut_lines": ("start", ("column",)),
    "repeat_lines": ("start", ("share",)),
    "lost_lines": ("start", ("share",)),
    "lag": ("start", ("slowness",)),
    "log_scrolled": ("copy", ("lines",)),
    "resize": ("open_folder", ("width", "height")),
}
"""Per kind: where it strikes when that is not told, and its options."""

_COMMON: Final = ("fault", "at", "times")
ONLY_AT: Final = {
    kind: KINDS[kind][0]
    for kind in (
        "slow_load",
        "clipboard_stolen",
        "lua_error",
        "cut_lines",
        "repeat_lines",
        "lost_lines",
        "lag",
        "log_scrolled",
    )
}


class FaultError(ValueError):
    """A fault nobody knows; the message names it and the valid choices."""


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
    entries = json.loads(path.read_text())
    if not isinstance(entries, list):
        raise FaultError("a file of faults is a list of objects")
    return [_fault(entry) for entry in entries]


def _fault(entry: object) -> Fault:
    if not isinstance(entry, dict) or not isinstance(entry.get("fault"), str):
        raise FaultError(f'a fault is an object with "fault", not {entry!r}')
    kind = entry["fault"]
    if kind not in KINDS:
        raise FaultError(f"there is no fault {kind!r}; choices: {', '.join(KINDS)}")
    usual, options = KINDS[kind]
    unknown = [name for name in entry if name not in (*_COMMON, *options)]
    if unknown:
        choices = ", ".join((*_COMMON, *options))
        raise FaultError(f"{kind}: there is no {unknown[0]!r}; choices: {choices}")
    point, times = entry.get("at", usual), entry.get("times", 1)
    if point not in POINTS:
        raise FaultError(f"{kind}: there is no point {point!r}; choices: {', '.join(POINTS)}")
    if kind in ONLY_AT and point != usual:
        raise FaultError(f"{kind}: strikes at {usual!r} only, not at {point!r}")
    if times is not None and (not isinstance(times, int) or isinstance(times, bool) or times < 0):
        raise FaultError(f"{kind}: times is a whole number or null (forever), not {times!r}")
    told = {name: entry[name] for name in options if name in entry}
    return Fault(kind=kind, at=str(point), left=times, options=told)
