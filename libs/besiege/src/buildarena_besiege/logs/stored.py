"""From the stored log of a trial in the game to its trajectory."""

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
    """What the stored log of a trial tells; the game itself plays nothing again.

    Args:
        text: The log.
        versions: The rollout's: game, mod and run.
        machine: What was played.
        scenario: What it was put through.

    Raises:
        LogIncompleteError: It does not tell enough.
    """
    run, game, mod = (str(versions.get(name)) for name in ("run", "game", "mod"))
    lines = GameLog(run)
    lines.read(text)
    return trajectory_of(lines, machine, scenario, game=game, mod=mod)
