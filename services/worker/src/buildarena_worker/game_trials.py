"""Trials in the game, looked at again by our engines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.annotations import annotate
from buildarena_benchmark import Task
from buildarena_geometry import KeyPress, Machine

VERSIONS = ("simulation", "engine_version")


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
