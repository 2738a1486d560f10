"""Walks a person through calibration, and tries the result with a small machine."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from typing import Final

from buildarena_besiege import GameRun, prepare_run
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simworker_besiege.desktop import Desktop
from buildarena_simworker_besiege.errors import DesktopError, NotSetUpError
from buildarena_simworker_besiege.play import RunFailedError, play
from buildarena_simworker_besiege.screen.calibration import POSITIONS, Calibration
from buildarena_simworker_besiege.screen.input import ScreenInput
from buildarena_simworker_besiege.screen.windows import Area, Windows
from buildarena_simworker_besiege.time_limits import TimeLimits

BEFORE: Final = {
    "name_box": "Open the list of machine files in the game.",
    "set_ground": "Close the list of machine files.",
    "log_window": "Press Ctrl+L in the game: the Lua panel shows. Move it clear of buttons.",
    "empty_space": "Press Ctrl+L in the game again, so that the Lua panel is hidden.",
    "confirm": "Click the button that deletes the machine, so that the game asks for confirmation.",
}
"""What must be done in the game before some places can be seen."""
TRIAL_S: Final = 2.0
KEEP: Final = "k"

Ask = Callable[[str], str]
Tell = Callable[[str], None]


def ask_positions(
    screen_input: ScreenInput,
    windows: Windows,
    title: str,
    *,
    ask: Ask,
    tell: Tell,
    before: Calibration,
) -> Calibration:
    """Asks for each place; a person points at it with the mouse.

    Args:
        screen_input: Tells where the mouse is.
        windows: The screen's windows.
        title: Part of the window's title.
        ask: Shows a question and gives the answer.
        tell: Shows a line.
        before: Positions that are kept unless the answer changes them.

    Raises:
        NotSetUpError: There is no such window.
    """
    places = dict(before.positions)
    for name, (_, description) in POSITIONS.items():
        if name in BEFORE:
            tell(BEFORE[name])
        while True:
            answer = ask(
                f"Point the mouse at {description}, and press Enter here "
                f"({KEEP} and Enter keeps {places[name][0]:.3f}, {places[name][1]:.3f}): "
            )
            if answer.strip().casefold() == KEEP:
                break
            window = _window(windows, title)
            position = _fractions(screen_input.position(), window)
            if position is not None:
                places[name] = position
                break
            tell("The mouse is not over the game's window.")
    window = _window(windows, title)
    return Calibration(positions=places, window=(window.width, window.height))


def try_out(desktop: Desktop, limits: TimeLimits, tell: Tell) -> bool:
    """Plays a machine of two blocks for two seconds, from loading to deleting.

    Args:
        desktop: The game, driven by the positions to be tried.
        limits: How long to wait.
        tell: Shows a line for each thing that worked or did not.

    Returns:
        Whether everything worked.
    """
    machine = Machine()
    machine.act("start", {})
    machine.act(
        "attach_block_to",
        {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""},
    )
    scenario = Scenario.model_validate({"duration_s": TRIAL_S, "control": {"mode": "agent"}})

    def make_run(attempt: int) -> GameRun:
        return prepare_run(
            machine, scenario, name="batry", run_id=f"try{attempt}{uuid.uuid4().hex[:8]}"
        )

    try:
        played = play(
            desktop,
            make_run,
            lambda _, log: desktop.trajectory(log, machine, scenario),
            require_held=lambda: None,
            limits=limits,
        )
    except (RunFailedError, DesktopError) as error:
        tell(f"It does not work yet: {error}")
        return False
    tell(f"Loaded, started, read ({TRIAL_S:.0f} s at {played.pace:.2f} of real time), deleted.")
    for fault in played.faults:
        tell(f"It needed another try: {fault}")
    return True


def _window(windows: Windows, title: str) -> Area:
    window = windows.find(title)
    if window is None:
        raise NotSetUpError(
            f"no window has {title!r} in its title: start the game, or correct "
            "BUILDARENA_BESIEGE_TITLE"
        )
    return window


def _fractions(point: tuple[int, int], window: Area) -> tuple[float, float] | None:
    x, y = (point[0] - window.left) / window.width, (point[1] - window.top) / window.height
    inside = 0 <= x <= 1 and 0 <= y <= 1
    return (round(x, 4), round(y, 4)) if inside else None
