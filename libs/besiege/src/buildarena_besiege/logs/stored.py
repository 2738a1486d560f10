"""Conversion of the stored log of a trial in the game to its trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from buildarena_besiege.logs.game_log import GameLog
from buildarena_besiege.logs.trajectories import trajectory_of
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory


def logged_trajectory(
    text: str, versions: Mapping[str, Any], machine: Machine, scenario: Scenario
) -> Trajectory:
    """Return the trajectory in the stored log of a trial; the game does not run again.

    Args:
        versions: Versions of the trial: game, mod and run.

    Raises:
        LogIncompleteError: It is incomplete.
    """
    run, game, mod = (str(versions.get(name)) for name in ("run", "game", "mod"))
    lines = GameLog(run)
    lines.read(text)
    return trajectory_of(lines, machine, scenario, game=game, mod=mod)
