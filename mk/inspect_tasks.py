"""Script that writes the numbers of tasks' versions in Inspect.

A number rises when the task's results stop being comparable to earlier ones.
"""

from __future__ import annotations

import json
from pathlib import Path

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_simulation import SIMULATION_VERSION

ROOT = Path(__file__).parents[1]
VERSIONS = ROOT / "integrations/inspect/src/buildarena_inspect/versions.json"


def compared(name: str) -> str:
    """Return the versions that must be equal for comparable results of a task."""
    version = builtin_tasks()[name].version
    return f"task {version}, simulation {SIMULATION_VERSION}, feedback {FEEDBACK_VERSION}"


def versions_file(present: str) -> str:
    """Return the text of `versions.json`, raising the numbers of tasks that changed."""
    previous = json.loads(present)
    versions = {}
    for name in builtin_tasks():
        was = previous.get(name, {"number": 0, "of": None})
        now = compared(name)
        versions[name] = {"number": was["number"] + (was["of"] != now), "of": now}
    lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in versions.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    VERSIONS.write_text(versions_file(VERSIONS.read_text(encoding="utf-8")), encoding="utf-8")
