"""Writes the tasks of Inspect's adapter, and the numbers of their versions.

Registers and `inspect list tasks` read a file of tasks without running it, so each task has a function
in it. The number of a task's version rises when its results stop being comparable to earlier ones.
"""

from __future__ import annotations

import json
from pathlib import Path

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_simulation import SIMULATION_VERSION

PACKAGE = Path(__file__).parents[1] / "integrations/inspect/src/buildarena_inspect"
TASKS = PACKAGE / "tasks.py"
VERSIONS = PACKAGE / "versions.json"
HEAD = '''\
"""Inspect's tasks, one for each of BuildArena's. `make generate NAME=inspect` writes this file."""

from typing import Unpack

from inspect_ai import Task, task

from buildarena_inspect.task_factory import TASK_NAMES, TaskArguments, task_of
'''
FUNCTION = '''

@task
def {function}(**arguments: Unpack[TaskArguments]) -> Task:
    """{title}."""
    return task_of({name}, **arguments)
'''


def tasks_file() -> str:
    """The text of `tasks.py`."""
    functions = [
        FUNCTION.format(function=name.replace("-", "_"), title=task.title, name=f'"{name}"')
        for name, task in builtin_tasks().items()
    ]
    everything = FUNCTION.format(
        function="all_tasks", title="All tasks, each a sample", name="*TASK_NAMES"
    ).replace("@task\n", '@task(name="all")\n')
    return "".join([HEAD, *functions, everything])


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
    TASKS.write_text(tasks_file(), encoding="utf-8")
    VERSIONS.write_text(
        versions_file(VERSIONS.read_text(encoding="utf-8") if VERSIONS.exists() else "{}"),
        encoding="utf-8",
    )
