"""What runs a machine: our engines, and the game where an operator has it."""

from __future__ import annotations

from typing import Final

from buildarena_benchmark import ValidationIssue
from buildarena_simulation import ENGINES, SIMULATION_VERSION

BESIEGE: Final = "besiege"
"""The game itself, played by a runner on a machine that has it."""
ENGINE_SIMULATORS: Final = tuple(ENGINES)
"""Simulators of ours that are installed here, the first by default."""
SIMULATORS: Final = (*ENGINE_SIMULATORS, BESIEGE)
"""Simulators that jobs can name; each has a queue of its own."""


def simulation_version(simulator: str, game: str | None) -> str:
    """The version in a track's name: that of our physics, or of the game with its mod.

    Args:
        simulator: One of `SIMULATORS`.
        game: The game and mod that this service plays; None where it has no game.

    Raises:
        ValueError: The simulator is the game, and there is none.
    """
    if simulator != BESIEGE:
        return SIMULATION_VERSION
    if game is None:
        raise ValueError(NO_GAME)
    return game


def served(game: str | None) -> tuple[str, ...]:
    """Simulators that this service takes jobs for.

    Args:
        game: As in `simulation_version`.
    """
    return ENGINE_SIMULATORS if game is None else SIMULATORS


def simulator_issues(simulator: str, game: str | None) -> list[ValidationIssue]:
    """What is wrong with the simulator that a submission names: one issue, or none.

    Args:
        simulator: The name.
        game: As in `simulation_version`.
    """
    choices = served(game)
    if simulator in choices:
        return []
    message = NO_GAME if simulator == BESIEGE else f"there is no simulator {simulator!r}"
    return [ValidationIssue(path="simulator", message=message, choices=choices)]


NO_GAME: Final = (
    "this service has no game to play: its operator names one by BUILDARENA_BESIEGE_GAME and "
    "BUILDARENA_BESIEGE_MOD, the versions of Besiege and of its Lua Scripting Mod"
)
"""Why a job for the game is refused."""
