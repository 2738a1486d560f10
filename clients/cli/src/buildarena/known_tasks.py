"""The built-in tasks, as notebooks choose them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from buildarena_benchmark import Task, builtin_tasks, load_task


def tasks() -> Mapping[str, Task]:
    """Return the tasks that come with BuildArena, by name."""
    return builtin_tasks()


def chosen_task(task: str | Path | Task) -> Task:
    """Return a task by its name, its file, or as it is.

    Raises:
        ValueError: There is no such task.
        TaskError: The file is wrong.
    """
    if isinstance(task, Task):
        return task
    known = builtin_tasks()
    if str(task) in known:
        return known[str(task)]
    if Path(task).is_file():
        return load_task(Path(task))
    raise ValueError(f"no task {str(task)!r}; there are {', '.join(known)}, or name a task file")
