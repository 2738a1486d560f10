"""Writes the numbers of the versions that tasks have in Inspect.

A number rises when the task's results stop being comparable to earlier ones.
"""

from __future__ import annotations

import json
from pathlib import Path

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_simulation import SIMULATION_VERSION

PACKAGE = Path(__file__).parents[1] / "integrations/inspect/src/buildarena_inspect"
VERSIONS = PACKAGE / "versions.json"


def compared(name: str) -> str:
    """What must be equal for two results of a task to be comparable."""
    version = builtin_tasks()[name].version
    return f"task {version}, simulation {SIMULATION_VERSION}, feedback {FEEDBACK_VERSION}"


def versions_file(present: str) -> str:
    """The text of `versions.json`, in which the number of each task that changed is one higher."""
    known = json.loads(present)
    found = {}
    for name in builtin_tasks():
        was = known.get(name, {"number": 0, "of": None})
        now = compared(name)
        found[name] = {"number": was["number"] + (was["of"] != now), "of": now}
    lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in found.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    VERSIONS.write_text(
        versions_file(VERSIONS.read_text(encoding="utf-8") if VERSIONS.exists() else "{}"),
        encoding="utf-8",
    )
