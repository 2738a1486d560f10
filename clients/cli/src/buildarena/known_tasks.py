"""The built-in tasks, as notebooks list them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from buildarena_benchmark import Task, builtin_tasks, load_task


class Tasks(Mapping[str, Task]):
    """Tasks by name; shown as a table."""

    def __init__(self, known: Mapping[str, Task]) -> None:
        self._known = dict(known)

    def __getitem__(self, name: str) -> Task:
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)

    def __repr__(self) -> str:
        width = max(map(len, self._known), default=0)
        return "\n".join(f"{name:<{width}}  {task.title}" for name, task in self._known.items())

    def _repr_mimebundle_(self, **_asked: Any) -> dict[str, str]:
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(task.title)}</td>"
            f"<td>{escape(task.category)}</td><td>{task.level}</td>"
            f"<td>{escape(task.indicator.name)}</td></tr>"
            for name, task in self._known.items()
        )
        head = "".join(f"<th>{name}</th>" for name in ("task", "title", "kind", "level", "figure"))
        return {"text/plain": repr(self), "text/html": f"<table><tr>{head}</tr>{rows}</table>"}


def tasks() -> Tasks:
    """The tasks that come with BuildArena, by name."""
    return Tasks(builtin_tasks())


def chosen_task(task: str | Path | Task) -> Task:
    """A task by its name, its file, or as it is.

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
