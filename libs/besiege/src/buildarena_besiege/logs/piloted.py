"""What a log tells of a program: its senses and answers, which it must give again here."""

from __future__ import annotations

from typing import Final

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.exporting.pilot import pilot_of
from buildarena_besiege.keys import UPDATES_PER_S
from buildarena_besiege.logs.game_log import GameLog
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.controllers.pilot import ProgramPilot

ALIKE: Final = 1.001e-6
"""By how much an answer in the log may miss that of the program here: its last decimal."""

_TICK_UPDATES: Final = UPDATES_PER_S // SAMPLE_RATE_HZ


def piloted_again(log: GameLog, machine: Machine, scenario: Scenario) -> ProgramPilot | None:
    """A machine's program after it was asked again what it was asked in the game.

    Args:
        log: The run's log.
        machine: The machine that was played.
        scenario: What it was put through.

    Returns:
        None where no program acted.

    Raises:
        ControllerFailed: The program failed in the game, and does so here.
        LogIncompleteError: A tick is missing, or the program answers otherwise here.
    """
    ticks = _ticks(log)
    if not machine.controller or not ticks:
        return None
    pilot = pilot_of(machine, scenario)
    sense_count, order = len(pilot.sense_names), sorted(pilot.channels.names)
    failed = {line.update for line in log.lines if line.kind == "f"}
    for tick in range(scenario.sample_count - 1):
        update, time_s = max(tick * _TICK_UPDATES, 1), tick / SAMPLE_RATE_HZ
        figures = ticks.get(update)
        whole = sense_count + (0 if update in failed else len(order))
        if figures is None or len(figures) != whole:
            raise LogIncompleteError(
                f"The log does not tell all that the program sensed and answered at {time_s:.2f} s."
            )
        levels = pilot.answered_to(figures[:sense_count], time_s)
        answers = zip(order, figures[sense_count:], strict=False)
        if update in failed or any(abs(levels.get(key, 0.0) - n) > ALIKE for key, n in answers):
            raise LogIncompleteError(
                f"At {time_s:.2f} s the program answered otherwise in the game than it does here."
            )
    return pilot


def _ticks(log: GameLog) -> dict[int, list[float]]:
    """The figures of each update all of whose lines are there, in their order."""
    figures: dict[int, list[float]] = {}
    parts: dict[int, list[int]] = {}
    for line in log.lines:
        if line.kind == "p":
            figures.setdefault(line.update, []).extend(line.figures)
            parts.setdefault(line.update, [line.parts]).append(line.part)
    return {
        update: figures[update]
        for update, (count, *seen) in parts.items()
        if seen == list(range(1, count + 1))
    }
