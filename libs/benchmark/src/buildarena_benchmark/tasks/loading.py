"""Loading of task files: the built-in ones and custom ones."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Final

import yaml

from buildarena_benchmark.categories import categories
from buildarena_benchmark.errors import SourceError, TaskError, ValidationIssue
from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.sources import parse_model, parse_source
from buildarena_benchmark.tasks.task import Task, task_of

_OWN: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@cache
def builtin_tasks() -> Mapping[str, Task]:
    """Return the built-in tasks by name, category by category."""
    tasks = {}
    for category in categories():
        for file in sorted(category.folder.glob("*-*.yaml")):
            # Built-in files: read by libyaml, five times as fast as the safe reader.
            content = yaml.load(file.read_text(encoding="utf-8"), Loader=_OWN)  # noqa: S506 - makes plain values
            tasks[file.stem] = task_of(TaskDocument.model_validate(content))
    return MappingProxyType(tasks)


@cache
def paper_tasks() -> Mapping[str, Task]:
    """Return the paper's nine tasks by name: those that the overall ranking is over."""
    names = [name for category in categories() for name in category.paper]
    return MappingProxyType({name: builtin_tasks()[name] for name in names})


@cache
def references() -> Mapping[str, float]:
    """Return the built-in expert's indicators on MuJoCo, by built-in task."""
    values: dict[str, float] = {}
    for category in categories():
        values |= category.references
    return MappingProxyType(values)


def load_task(source: str | Path) -> Task:
    """Return a task from a YAML text or file.

    Args:
        source: A `Path`, a one-line string naming a file, or the YAML text itself.

    Raises:
        TaskError: The file cannot be read or is not a valid task; names line, field and choices.
    """
    if isinstance(source, Path) or "\n" not in source:
        path = Path(source)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise TaskError(
                [ValidationIssue(message=f"cannot be read: {error}")], origin=str(path)
            ) from error
        return parse_task(text, origin=path.name)
    return parse_task(source, origin="task")


def parse_task(text: str, *, origin: str) -> Task:
    """Return a task from a YAML text; safe for untrusted texts.

    Args:
        origin: Name of the text in messages.

    Raises:
        TaskError: It is not a valid task; names line, field and choices.
    """
    try:
        return task_of(parse_model(text, TaskDocument, origin=origin))
    except SourceError as error:
        raise TaskError(error.issues, origin=origin) from error


def parse_custom_task(text: str, *, origin: str) -> Task:
    """Return a custom task from a YAML text: like `parse_task`, but refuse names that are taken.

    Raises:
        TaskError: It is not a valid task, or its name is a built-in task's.
    """
    task = parse_task(text, origin=origin)
    if task.name in builtin_tasks():
        line = parse_source(text, origin=origin).line_of(["name"])
        message = f"{task.name} is a built-in task: choose another name"
        raise TaskError([ValidationIssue(path="name", line=line, message=message)], origin=origin)
    return task
