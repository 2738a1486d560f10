"""Draws what changes: the runner looks whether something appeared where it clicked."""

import tkinter as tk
from typing import Final

from support.game.stand_in_game.game import SIZE
from support.game.stand_in_game.interface import Interface
from support.game.stand_in_game.layout import (
    CONFIRM_ITEMS,
    CONFIRM_PANEL,
    DIALOG_ITEMS,
    DIALOG_PANEL,
    LEVELS_ITEMS,
    LOAD_ITEMS,
    LOAD_PANEL,
    LOG_PANEL,
    LUA_PANEL,
    TITLE_ITEMS,
    TOOLBAR,
    Box,
    log_text,
)

MACHINE: Final = Box(0.400, 0.450, 0.700, 0.700)
ON_GROUND: Final = Box(0.400, 0.600, 0.700, 0.850)


Shape = tuple[Box, str, str]
"""Where, in what colour, and what is written there."""


def shapes(shown: Interface) -> list[Shape]:
    """What is seen: panels as boxes, the uppermost last."""
    game, name = shown.game, shown.name_box
    if shown.scene != "level":
        return _buttons(TITLE_ITEMS if shown.scene == "title" else LEVELS_ITEMS)
    seen: list[Shape] = []
    if game.run is not None:
        seen.append((ON_GROUND if game.grounded else MACHINE, "brown", ""))
    if game.simulating:
        seen.append((TOOLBAR["start"], "orange", f"{game.time_s:.2f} s"))
    else:
        seen += _buttons(TOOLBAR)
    if shown.load_panel:
        said = name.text + "|" * (shown.focus == "name")
        seen += [(LOAD_PANEL, "beige", game.message), *_buttons(LOAD_ITEMS)]
        seen.append((LOAD_ITEMS["name_box"], "skyblue" if name.selected else "white", said))
    if shown.lua_panel:
        seen.append((LUA_PANEL, "gray", "Lua Scripting"))
        if game.log.count:
            marked = shown.log_selected and shown.focus == "log"
            text = log_text(game.log.count)
            seen.append((LOG_PANEL, "gray", "Log"))
            seen.append((text, "skyblue" if marked else "white", game.log.text()[:2000]))
    if shown.confirm:
        seen += [(CONFIRM_PANEL, "beige", "Remove the machine?"), *_buttons(CONFIRM_ITEMS)]
    if shown.dialog:
        seen += [(DIALOG_PANEL, "white", shown.dialog), *_buttons(DIALOG_ITEMS)]
    return seen


def _buttons(items: dict[str, Box]) -> list[Shape]:
    return [(box, "khaki", name) for name, box in items.items()]


def draw(canvas: tk.Canvas, seen: list[Shape]) -> None:
    """Draws everything anew."""
    canvas.delete("all")
    width, height = SIZE
    for box, fill, words in seen:
        left, top = box.left * width, box.top * height
        canvas.create_rectangle(left, top, box.right * width, box.bottom * height, fill=fill)
        canvas.create_text(left + 2, top + 2, anchor="nw", text=words)
