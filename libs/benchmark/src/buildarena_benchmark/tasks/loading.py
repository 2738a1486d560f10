"""Reads task files: the built-in ones and custom ones."""

import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Final

import yaml

from buildarena_benchmark.errors import SourceError, TaskError, ValidationIssue
from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.sources import read_model, read_source
from buildarena_benchmark.tasks.task import Task, task_of

_PAPER: Final = tuple(
    f"{category}-{level}" for category in ("transport", "support", "lift") for level in (1, 2, 3)
)
_WORKSHOP: Final = (*(f"mechanisms-{level}" for level in (1, 2, 3, 4)), "flight-1", "flight-2")
_HEADROOM: Final = (
    *("support-4", "support-5", "mechanisms-5", "mechanisms-6", "transport-4"),
    *("flight-3", "lift-4", "mechanisms-7", "support-6", "support-7"),
)
_FAMILIES: Final = ("budget-1", "repair-1", "identify-1")
_CONTROL: Final = (
    "landing-1",
    "landing-2",
    "slalom-2",
    "hover-3",
    "hover-4",
    "balance-1",
    "balance-2",
    "walk-1",
    "walk-2",
    "place-2",
    "line-1",
)
_THROWING: Final = ("throw-1", "throw-2", "throw-3", "throw-4", "throw-5")
_SPACE: Final = ("orbit-1", "orbit-2")
_COURSES: Final = (
    "deliver-1",
    "deliver-2",
    "deliver-3",
    "drive-1",
    "drive-2",
    "drive-3",
    "drive-4",
    "fetch-1",
)
_OWN: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@cache
def builtin_tasks() -> Mapping[str, Task]:
    """The built-in tasks by name: the paper's nine in its order, the workshop's, then the rest."""
    folder = resources.files("buildarena_benchmark.tasks") / "catalogue"
    tasks = {}
    further = (*_HEADROOM, *_FAMILIES, *_CONTROL, *_THROWING, *_SPACE, *_COURSES)
    for name in (*_PAPER, *_WORKSHOP, *further):
        text = (folder / f"{name}.yaml").read_text(encoding="utf-8")
        # Ours: read by libyaml, five times as fast as by what strangers' texts are read by.
        content = yaml.load(text, Loader=_OWN)  # noqa: S506 - makes plain values
        tasks[name] = task_of(TaskDocument.model_validate(content))
    return MappingProxyType(tasks)


@cache
def paper_tasks() -> Mapping[str, Task]:
    """The paper's nine tasks by name: those that the overall ranking is over."""
    return MappingProxyType({name: builtin_tasks()[name] for name in _PAPER})


@cache
def references() -> Mapping[str, float]:
    """The built-in expert's indicators on MuJoCo, by built-in task."""
    text = (resources.files("buildarena_benchmark.tasks") / "references.json").read_text("utf-8")
    return MappingProxyType({str(name): float(value) for name, value in json.loads(text).items()})


def load_task(source: str | Path) -> Task:
    """A task from a YAML text or file.

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
    """A task from a YAML text; safe for texts that strangers wrote.

    Args:
        text: The text.
        origin: What it is called in messages.

    Raises:
        TaskError: It is not a valid task; names line, field and choices.
    """
    try:
        return task_of(read_model(text, TaskDocument, origin=origin))
    except SourceError as error:
        raise TaskError(error.issues, origin=origin) from error


def parse_custom_task(text: str, *, origin: str) -> Task:
    """A custom task from a YAML text: as `parse_task`, but for names that are taken.

    Raises:
        TaskError: It is not a valid task, or its name is a built-in task's.
    """
    task = parse_task(text, origin=origin)
    if task.name in builtin_tasks():
        line = read_source(text, origin=origin).line_of(["name"])
        message = f"{task.name} is a built-in task: choose another name"
        raise TaskError([ValidationIssue(path="name", line=line, message=message)], origin=origin)
    return task
