"""Loading a machine by its name, in the game's list of machine files."""

from __future__ import annotations

import unicodedata

from buildarena_simworker.besiege.screen.actions import ScreenActions
from buildarena_simworker.besiege.screen.input import SELECT


def load_by_name(actions: ScreenActions, name: str) -> None:
    """Opens the list of machines, types the name, loads; a failure leaves the list closed.

    Raises:
        StepFailedError: The list does not open, take the name or close.
    """
    actions.opened("open the list of machines", "open_folder", "name_box")
    _type_name(actions, name)
    panel = actions.view.patch("name_box")
    actions.step(
        f"load the machine {name}",
        lambda: actions.click("open_machine"),
        lambda: (
            None
            if actions.view.differs("name_box", panel)
            else "the list of machines stayed open, so the game did not find or read its file"
        ),
        timeout_s=actions.limits.load_s,
        attempts=1,
    )


def shown_text(text: str) -> str:
    """A text without blanks around it and characters that nobody sees.

    The game's boxes append a space without width to what is copied out of them.
    """
    return "".join(
        letter for letter in text if unicodedata.category(letter) not in {"Cf", "Cc"}
    ).strip()


def _type_name(actions: ScreenActions, name: str) -> None:
    screen = actions.input

    def retype() -> None:
        actions.click("name_box")
        screen.wait(0.5)
        screen.hotkey(SELECT, "a")
        screen.wait(0.2)
        screen.press("backspace")
        screen.wait(0.2)
        screen.write(name)
        screen.wait(0.1 * len(name))

    def read_back() -> str | None:
        copied = screen.copy_all()
        typed = None if copied is None else shown_text(copied)
        if typed is not None and typed != name and typed.casefold() == name:
            screen.press("capslock")
        return None if typed == name else f"{typed!r} stands there instead"

    actions.step(f"type the name {name}", retype, read_back, timeout_s=0.0, attempts=1)
