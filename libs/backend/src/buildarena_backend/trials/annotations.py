"""Annotations of a trial in the game by our engines; never part of its score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from buildarena_benchmark import Task, score
from buildarena_besiege import game_start
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import ENGINES, BuildarenaSimulationError, simulate


def annotate(
    task: Task, machine: Machine, controls: Sequence[KeyPress] | None
) -> dict[str, dict[str, Any]]:
    """Return each engine's score of a trial from the game's start; failing engines are left out.

    Args:
        controls: Key presses; None for the machine's own.

    Returns:
        By engine: success, indicator, flags, and the versions of model and engine.
    """
    annotations: dict[str, dict[str, Any]] = {}
    for engine in ENGINES:
        try:
            start = game_start(machine, task.scenario)
            trajectory = simulate(machine, task.scenario, engine, controls=controls, start=start)
        except BuildarenaSimulationError:
            continue
        measured = score(task, machine, trajectory)
        annotations[engine] = {
            "success": measured.success,
            "indicator": measured.indicator,
            "flags": list(measured.flags),
            "simulation": trajectory.simulation_version,
            "engine_version": trajectory.engine_version,
        }
    return annotations
