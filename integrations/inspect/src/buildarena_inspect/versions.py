"""Versions that determine results, and versions of tasks in Inspect's form."""

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
"""The X of `N-X`: the next letter for incompatible changes of arguments or logs."""
FILE: Final = "versions.json"
"""N and its content by task; `make generate NAME=inspect` raises N where the content changed."""


def inspect_version(tasks: Sequence[str]) -> str:
    """Return the version of a task of Inspect in the form `N-X`.

    Args:
        tasks: Names of its samples' tasks. N is the sum of their numbers, so it rises with each of
            them, and with each added task.
    """
    numbers = json.loads(files("buildarena_inspect").joinpath(FILE).read_text(encoding="utf-8"))
    return f"{sum(numbers[name]['number'] for name in tasks)}-{INTERFACE}"


def result_versions(simulator: str) -> Mapping[str, str | int]:
    """Return the versions of engine, simulation, scorers and building rules."""
    return {
        "engine_version": engine_version(simulator),
        "simulation_version": SIMULATION_VERSION,
        "scorer_version": SCORER_VERSION,
        "feedback_version": FEEDBACK_VERSION,
    }


def task_metadata(tasks: Sequence[str], simulator: str) -> dict[str, object]:
    """Return the versions for the log of a task of Inspect."""
    return {
        "adapter_version": version("buildarena-inspect"),
        "simulator": simulator,
        **result_versions(simulator),
        "task_versions": {name: builtin_tasks()[name].version for name in tasks},
    }
