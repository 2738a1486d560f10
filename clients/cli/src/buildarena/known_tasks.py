"""Selection of tasks in notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from buildarena_benchmark import Task, builtin_tasks, load_task
from buildarena_cli.errors import did_you_mean


def tasks() -> Mapping[str, Task]:
    """Return the tasks that come with BuildArena, by name."""
    return builtin_tasks()


def resolve_task(task: str | Path | Task) -> Task:
    """Return a task, given itself, its name or its file.

    Raises:
        ValueError: The task is unknown.
        TaskError: The file is wrong.
    """
    if isinstance(task, Task):
        return task
    tasks = builtin_tasks()
    if str(task) in tasks:
        return tasks[str(task)]
    if Path(task).is_file():
        return load_task(Path(task))
    raise ValueError(
        f"unknown task {str(task)!r}; valid tasks: {', '.join(tasks)}, or a task file"
        f"{did_you_mean(str(task), tasks)}"
    )
