"""Versions of everything that can change a result, and of tasks as Inspect writes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files
from typing import Final

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.tasks.task import SCORER_VERSION
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_simulation import SIMULATION_VERSION, engine_version

INTERFACE: Final = "A"
"""The X of `N-X`: the next letter when a task's arguments or its log change for who uses them."""
FILE: Final = "versions.json"
"""By task: N, and what it numbers. `make generate NAME=inspect` raises N where that changed."""


def inspect_version(tasks: Sequence[str]) -> str:
    """The version of a task of Inspect in the form `N-X`.

    Args:
        tasks: Our tasks that it has as samples. N is the sum of theirs, so it rises with each of
            them, and with each that is added.
    """
    numbers = json.loads(files("buildarena_inspect").joinpath(FILE).read_text(encoding="utf-8"))
    return f"{sum(numbers[name]['number'] for name in tasks)}-{INTERFACE}"


def result_versions(simulator: str) -> Mapping[str, str | int]:
    """The versions of what judges: engine, simulation, scorers, and the rules of building."""
    return {
        "engine_version": engine_version(simulator),
        "simulation_version": SIMULATION_VERSION,
        "scorer_version": SCORER_VERSION,
        "feedback_version": FEEDBACK_VERSION,
    }


def task_metadata(tasks: Sequence[str], simulator: str) -> dict[str, object]:
    """What the log of a task of Inspect says of its versions."""
    return {
        "adapter_version": version("buildarena-inspect"),
        "simulator": simulator,
        **result_versions(simulator),
        "task_versions": {name: builtin_tasks()[name].version for name in tasks},
    }
