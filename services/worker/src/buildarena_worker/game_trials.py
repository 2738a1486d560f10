"""Trials in the game, looked at again: from their kept logs, and by our engines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from buildarena_benchmark import Task
from buildarena_besiege import GameLog, StateLog, trajectory_of
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.runtime.annotations import annotate
from buildarena_simulation import Trajectory
from buildarena_store import RolloutRecord

VERSIONS = ("simulation", "engine_version")


def logged_trajectory(
    text: str, versions: Mapping[str, Any], machine: Machine, task: Task
) -> Trajectory:
    """What the kept log of a trial tells; the game itself plays nothing again.

    Args:
        text: The log.
        versions: The rollout's: game, mod, run, and how the game was driven.
        machine: What was played.
        task: What it was put through.

    Raises:
        LogIncompleteError: It does not tell enough.
    """
    run, game, mod = (str(versions.get(name)) for name in ("run", "game", "mod"))
    if versions.get("desktop") == "headless":
        states = StateLog(run)
        states.read(text)
        return states.trajectory(machine, task.scenario, game=game, mod=mod)
    lines = GameLog(run)
    lines.read(text)
    return trajectory_of(lines, machine, task.scenario, game=game, mod=mod)


def annotations_again(
    record: RolloutRecord, task: Task, machine: Machine, controls: Sequence[KeyPress] | None
) -> Iterator[tuple[str, Any, Any]]:
    """What our engines said of a trial, and what they say now.

    Engines of other versions may say otherwise; they are left out.

    Args:
        record: The rollout in the game.
        task: What the machine was put through.
        machine: The machine.
        controls: Key presses; None for the machine's own.

    Yields:
        Engine, what was kept, what was found.
    """
    annotations = annotate(task, machine, None if controls is None else tuple(controls))
    for engine, kept in (record.annotations or {}).items():
        found = annotations.get(engine)
        if found is not None and all(kept[name] == found[name] for name in VERSIONS):
            yield engine, kept, found
