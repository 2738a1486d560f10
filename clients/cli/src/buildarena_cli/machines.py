"""Machines for commands: read from files, tried, drawn; and the libraries' errors in words."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.errors import FAILED, CommandError
from buildarena_cli.near import did_you_mean
from buildarena_cli.terminal.output import warn

if TYPE_CHECKING:
    from rich.progress import Progress

    from buildarena_benchmark import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

MachineFile = Annotated[
    Path, typer.Argument(help="A machine document or an action log, JSON; - reads standard input.")
]


def read_machine(file: Path) -> Machine:
    """The machine of a file.

    Args:
        file: A machine document; a list of actions ({"op", "params"} or {"name", "arguments"});
            or an object with such a list under "actions" or "steps" and, for an assembly, the
            lists of its sub-structures by name under "sub_structures" or "sub_machines".

    Raises:
        CommandError: The file cannot be read or is none of these.
        DocumentError: The document is wrong.
    """
    from buildarena_geometry import Machine

    try:
        text = sys.stdin.read() if str(file) == "-" else file.read_text(encoding="utf-8")
        content = json.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise CommandError(f"{file}: not valid JSON: {error}") from error
    if isinstance(content, dict) and "blocks" in content:
        return Machine.from_document(content)
    if isinstance(content, list):
        content = {"actions": content}
    actions = content.get("actions", content.get("steps")) if isinstance(content, dict) else None
    if not isinstance(actions, list):
        raise CommandError(f"{file}: neither a machine document nor an action log")
    parts = content.get("sub_structures", content.get("sub_machines")) or {}
    if not isinstance(parts, dict):
        raise CommandError(f"{file}: sub_structures is an object of action logs by name")
    built = {name: _built(log, {}, f"{file}, {name}") for name, log in parts.items()}
    return _built(actions, built, str(file))


def _built(actions: Any, available: dict[str, Machine], where: str) -> Machine:
    """The machine a log builds; refused actions change nothing, as when they were made."""
    if not isinstance(actions, list) or not all(isinstance(action, dict) for action in actions):
        raise CommandError(f"{where}: an action log is a list of objects")
    from buildarena_geometry import Machine

    machine = Machine(available=available) if available else Machine()
    for action in actions:
        name = action.get("op", action.get("name"))
        machine.act(name, action.get("params", action.get("arguments")))
    return machine


def chosen_task(name: str) -> Task:
    """A built-in task, or the one in a file.

    Raises:
        CommandError: There is neither.
        TaskError: The file is wrong.
    """
    from buildarena_benchmark import builtin_tasks, load_task

    known = builtin_tasks()
    if name in known:
        return known[name]
    if Path(name).exists():
        return load_task(Path(name))
    raise CommandError(
        f"no task {name!r}; there are {', '.join(known)}, or name a task file"
        f"{did_you_mean(name, known)}"
    )


def film(machine: Machine, task: Task, rollout: Trajectory, video: Path) -> None:
    """Draws a trial into a film or pictures."""
    from buildarena_simulation.render.film import write_film

    with progress_bar() as bar:
        row = bar.add_task(f"drawing {video.name}", total=1.0)
        write_film(
            machine,
            task.scenario,
            rollout,
            video,
            on_progress=lambda done: bar.update(row, completed=done),
        )


def progress_bar() -> Progress:
    """A bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    return Progress(
        TextColumn("{task.description:<24}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )


@contextlib.contextmanager
def shown_errors() -> Iterator[None]:
    """Turns the errors of the libraries into one message and an exit code."""
    from buildarena_benchmark import TaskError
    from buildarena_geometry import GeometryError
    from buildarena_simulation import BuildarenaSimulationError, TrajectoryFormatError

    known = (
        *(CommandError, GeometryError, TaskError, TrajectoryFormatError, BuildarenaSimulationError),
        *(OSError, ValueError),
    )
    try:
        yield
    except ImportError as error:
        warn("error: pictures need `pip install buildarena-simulation[video]`")
        raise typer.Exit(FAILED) from error
    except known as error:
        warn(f"error: {error}")
        raise typer.Exit(FAILED) from error
