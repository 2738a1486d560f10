"""Draws the toolbar and the panels."""

from __future__ import annotations

import tkinter as tk
from tkinter.font import Font
from typing import Final

from stand_in_game.interface import Interface
from stand_in_game.layout import (
    BAR,
    CONFIRM_ITEMS,
    CONFIRM_PANEL,
    DIALOG_ITEMS,
    DIALOG_PANEL,
    LEVELS_ITEMS,
    LINE_HEIGHT,
    LOAD_ITEMS,
    LOAD_PANEL,
    TITLE_ITEMS,
    TOOLBAR,
    Box,
    log_panel,
    log_text,
    lua_panel,
)

MACHINE: Final = Box(0.400, 0.450, 0.700, 0.700)
ON_GROUND: Final = Box(0.400, 0.600, 0.700, 0.850)
_WORDS: Final = {
    "open_folder": "Load",
    "set_ground": "Set ground",
    "delete": "Clear",
    "open_machine": "Open",
    "confirm": "Yes",
    "cancel": "No",
    "dialog_ok": "OK",
    "to_levels": "Play",
    "to_level": "Sandbox",
}


class Panels:
    """Draws what lies over the world."""

    def __init__(self, canvas: tk.Canvas, size: tuple[int, int]) -> None:
        self._canvas = canvas
        self.resize(size)
        points = max(7, self._height // 66)
        self._font = Font(family="DejaVu Sans", size=-points)
        self._small = Font(family="DejaVu Sans Mono", size=-max(6, self._height // 80))

    def resize(self, size: tuple[int, int]) -> None:
        """Draws for a window of another size from now on."""
        self._width, self._height = size

    def draw(self, shown: Interface) -> None:
        """Draws everything anew."""
        self._canvas.delete("panel")
        if shown.scene != "level":
            self._box(Box(0.0, 0.0, 1.0, 1.0), "#31475e")
            self._buttons(TITLE_ITEMS if shown.scene == "title" else LEVELS_ITEMS)
            return
        if shown.game.run is not None:
            self._box(MACHINE if not shown.game.grounded else ON_GROUND, "#8a5a2b")
        self._bar(shown)
        if shown.load_panel:
            self._load(shown)
        if shown.lua_panel:
            self._lua(shown)
        if shown.confirm:
            self._box(CONFIRM_PANEL, "#f2ead8")
            self._text(0.40, 0.47, "Remove the machine?")
            self._buttons(CONFIRM_ITEMS)
        if shown.dialog:
            self._box(DIALOG_PANEL, "#f7f7f7")
            self._text(0.32, 0.36, shown.dialog)
            self._buttons(DIALOG_ITEMS)

    def _bar(self, shown: Interface) -> None:
        simulating = shown.game.simulating
        self._box(BAR, "#3d3a36")
        self._button(TOOLBAR["start"], "Stop" if simulating else "Play", on=simulating)
        if simulating:
            self._text(0.06, 0.035, f"{shown.game.time_s:6.2f} s", color="#f2ead8")
            return
        for name in ("open_folder", "set_ground", "delete"):
            on = (name == "open_folder" and shown.load_panel) or (
                name == "set_ground" and shown.game.grounded
            )
            self._button(TOOLBAR[name], _WORDS[name], on=on)
        name = shown.game.machine_name or "no machine"
        self._text(0.80, 0.035, name, color="#f2ead8")
        if shown.game.message:
            self._text(0.30, 0.95, shown.game.message, color="#9c2b1f")

    def _load(self, shown: Interface) -> None:
        self._box(LOAD_PANEL, "#e6dcc6")
        self._text(0.385, 0.155, "Load a machine")
        focused = shown.focus == "name"
        self._box(LOAD_ITEMS["name_box"], "#fffdf6", edge="#d07a26" if focused else "#8a8172")
        if shown.name_box.selected:
            self._box(Box(0.386, 0.203, 0.566, 0.228), "#bcd3f0", edge="")
        caret = "|" if focused else ""
        self._text(0.390, 0.215, shown.name_box.text + caret)
        self._button(LOAD_ITEMS["open_machine"], "…" if shown.loading else "Open")
        known = sorted(path.stem for path in shown.machines.glob("*.bsg"))[:7]
        for row, name in enumerate(known):
            self._text(0.390, 0.262 + 0.021 * row, name, font=self._small)

    def _lua(self, shown: Interface) -> None:
        """The mod's panel, and its log once something was printed."""
        size = (self._width, self._height)
        panel = lua_panel(size)
        self._box(panel, "#2a2d33")
        self._text(panel.left + 0.01, panel.top + 0.02, "Lua Scripting", color="#d7dae0")
        log, window = shown.game.log, log_panel(size)
        if not log.count:
            return
        self._box(window, "#2a2d33")
        self._text(window.left + 0.01, window.top + 0.02, "Log", color="#d7dae0")
        text = log_text(size, log.count)
        focused = shown.focus == "log"
        fill = "#2b4262" if shown.log_selected and focused else "#17191d"
        self._box(text, fill, edge="#d07a26" if focused else "#555a63")
        rows = round((text.bottom - text.top) * self._height / LINE_HEIGHT)
        columns = int((text.right - text.left) * self._width / self._small.measure("0")) - 2
        for row, line in enumerate(log.text().split("\n")[:rows]):
            self._canvas.create_text(
                (text.left + 0.004) * self._width,
                text.top * self._height + (row + 0.5) * LINE_HEIGHT,
                text=line[:columns],
                anchor="w",
                fill="#c8e0c0",
                font=self._small,
                tags="panel",
            )

    def _buttons(self, items: dict[str, Box]) -> None:
        for name, box in items.items():
            self._button(box, _WORDS[name])

    def _button(self, box: Box, words: str, *, on: bool = False) -> None:
        self._box(box, "#d9a441" if on else "#efe7d6")
        self._canvas.create_text(
            (box.left + box.right) / 2 * self._width,
            (box.top + box.bottom) / 2 * self._height,
            text=words,
            font=self._font,
            tags="panel",
        )

    def _box(self, box: Box, fill: str, *, edge: str = "#6d6454") -> None:
        self._canvas.create_rectangle(
            box.left * self._width,
            box.top * self._height,
            box.right * self._width,
            box.bottom * self._height,
            fill=fill,
            outline=edge,
            tags="panel",
        )

    def _text(
        self, x: float, y: float, words: str, *, color: str = "#2c2721", font: Font | None = None
    ) -> None:
        self._canvas.create_text(
            x * self._width,
            y * self._height,
            text=words,
            anchor="w",
            fill=color,
            font=font or self._font,
            tags="panel",
        )
