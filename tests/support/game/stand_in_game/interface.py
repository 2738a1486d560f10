"""What the window's panels and the keyboard do, apart from tkinter."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from support.game.stand_in_game.faults import Fault
from support.game.stand_in_game.game import LOAD_S, Game
from support.game.stand_in_game.layout import (
    CONFIRM_ITEMS,
    DIALOG_ITEMS,
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

Focus = Literal["name", "log"] | None
Scene = Literal["title", "levels", "level"]
LONGEST_NAME = 60
CARET = "\u200b"
"""The name box's own, which is copied with its text: a space without width."""


class Screen(Protocol):
    """What the interface needs of the window around it."""

    def later(self, seconds: float, work: Callable[[], None]) -> None:
        """Does something after some time of the wall clock."""

    def copy(self, text: str) -> None:
        """Puts a text into the clipboard."""

    def strike(self, fault: Fault) -> None:
        """Carries out a fault that is the window's business."""


@dataclass(slots=True)
class NameBox:
    """The box a machine's name is typed into; it keeps what was typed last."""

    text: str = "my machine"
    selected: bool = False

    def type(self, character: str) -> None:
        """Types a character."""
        self.text = (("" if self.selected else self.text) + character)[:LONGEST_NAME]
        self.selected = False

    def erase(self) -> None:
        """Takes what is selected away, or the last character."""
        self.text = "" if self.selected else self.text[:-1]
        self.selected = False


@dataclass(slots=True)
class Interface:
    """Panels, focus and what clicks and keys do."""

    game: Game
    machines: Path
    screen: Screen
    load_panel: bool = False
    loading: bool = False
    confirm: bool = False
    lua_panel: bool = False
    dialog: str = ""
    focus: Focus = None
    log_selected: int = 0
    """How many characters of the log, from its newest on."""
    scene: Scene = "level"
    name_box: NameBox = field(default_factory=NameBox)

    @property
    def phase(self) -> str:
        """What is going on: title, levels, build, load panel, confirm or simulating."""
        if self.scene != "level":
            return self.scene
        if self.game.simulating:
            return "simulating"
        if self.confirm:
            return "confirm"
        return "load panel" if self.load_panel else "build"

    def item_at(self, x: float, y: float) -> str:
        """What a click hits: an item's name, "panel" or "empty"."""
        if self.dialog:
            return _item(DIALOG_ITEMS, x, y) or "panel"
        if self.scene != "level":
            items = TITLE_ITEMS if self.scene == "title" else LEVELS_ITEMS
            return _item(items, x, y) or "empty"
        return self._mods_item(x, y) or self._games_item(x, y)

    def _mods_item(self, x: float, y: float) -> str:
        """The mod draws over everything of the game."""
        if not self.lua_panel:
            return ""
        lines = self.game.log.count
        if lines and LOG_PANEL.holds(x, y):
            return "log_window" if log_text(lines).holds(x, y) else "panel"
        return "panel" if LUA_PANEL.holds(x, y) else ""

    def _games_item(self, x: float, y: float) -> str:
        if self.confirm:
            return _item(CONFIRM_ITEMS, x, y) or "panel"
        if self.load_panel and LOAD_PANEL.holds(x, y):
            return _item(LOAD_ITEMS, x, y) or "panel"
        return _item(TOOLBAR, x, y) or "empty"

    def click(self, item: str) -> None:
        """Does what a click on an item does."""
        if item == "dialog_ok":
            self.dialog = ""
            return
        if item == "panel":
            return
        if item == "log_window":
            self.focus, self.log_selected = "log", 0
            return
        if item == "name_box":
            self.focus, self.name_box.selected = "name", False
            return
        self.focus = None
        action = _CLICKS.get(item)
        if action is not None:
            action(self)

    def key(self, keysym: str, character: str, *, control: bool) -> None:
        """Does what a key does."""
        if keysym == "Escape":
            self._close()
        elif self.dialog or self.confirm or self.scene != "level":
            return
        elif control:
            self._shortcut(keysym.lower())
        elif self.focus == "name":
            if keysym == "BackSpace":
                self.name_box.erase()
            elif character and character.isprintable():
                self.name_box.type(character)

    def toggle_simulation(self) -> None:
        """Starts the simulation, or stops it."""
        if self.game.simulating:
            self._strike("stop")
            if not self.dialog:
                self.game.stop()
        elif not self.load_panel and self.game.run is not None:
            for fault in self.game.start():
                self.carry_out(fault)

    def _open_folder(self) -> None:
        if self.game.simulating:
            return
        self._strike("open_folder")
        if not self.dialog:
            self.load_panel = not self.load_panel

    def _open_machine(self) -> None:
        if self.loading:
            return
        self.loading = True
        name = self.name_box.text
        self.screen.later(LOAD_S / self.game.speed, lambda: self._loaded(name))

    def _loaded(self, name: str) -> None:
        self.loading = False
        path = self.machines / f"{name}.bsg"
        # Listing the folder keeps capitals apart where the file system does not.
        known = {entry.name for entry in self.machines.glob("*.bsg")}
        if path.name not in known:
            self.game.message = f'there is no machine "{name}"'
        elif self.game.load(path):
            self.load_panel, self.focus = False, None

    def _set_ground(self) -> None:
        if not (self.game.simulating or self.load_panel):
            self.game.set_ground()

    def _delete(self) -> None:
        if not (self.game.simulating or self.load_panel):
            self.confirm = True

    def _confirmed(self) -> None:
        self.game.delete()
        self.confirm = False

    def _to_levels(self) -> None:
        self.scene = "levels"

    def _to_level(self) -> None:
        self.scene = "level"

    def _close(self) -> None:
        if self.dialog:
            self.dialog = ""
        elif self.confirm:
            self.confirm = False
        elif self.load_panel:
            self.load_panel, self.focus = False, None
        else:
            self.focus = None

    def _shortcut(self, key: str) -> None:
        if key == "l":
            if self.focus == "log":  # a text that has the keyboard takes every shortcut
                return
            self.lua_panel = not self.lua_panel
        elif self.focus == "name":
            self._name_shortcut(key)
        elif self.focus == "log" and key == "a":
            self.log_selected = len(self.game.log.text())
        elif self.focus == "log" and key == "c" and self.log_selected:
            self._copy_log()

    def _name_shortcut(self, key: str) -> None:
        if key == "a":
            self.name_box.selected = True
        elif key == "c" and self.name_box.selected:
            self.screen.copy(self.name_box.text + CARET)

    def _copy_log(self) -> None:
        self._strike("copy")
        # What was printed since it was selected pushes the oldest lines out of the selection.
        self.screen.copy(self.game.log.text()[: self.log_selected])

    def _strike(self, point: str) -> None:
        """The faults at a point happen at once."""
        for fault in self.game.faults.at(point):
            self.carry_out(fault)

    def carry_out(self, fault: Fault) -> None:
        """Does what a fault does to the window."""
        if fault.kind == "dialog":
            self.dialog = "A new version of the game is available."
        else:
            self.screen.strike(fault)


def _item(items: Mapping[str, Box], x: float, y: float) -> str:
    return next((name for name, box in items.items() if box.holds(x, y)), "")


_CLICKS: dict[str, Callable[[Interface], None]] = {
    "start": Interface.toggle_simulation,
    "open_folder": Interface._open_folder,
    "open_machine": Interface._open_machine,
    "set_ground": Interface._set_ground,
    "delete": Interface._delete,
    "confirm": Interface._confirmed,
    "to_levels": Interface._to_levels,
    "to_level": Interface._to_level,
}
