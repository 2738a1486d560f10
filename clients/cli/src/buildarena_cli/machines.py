"""Machines for commands: read, simulated and drawn; and the messages of libraries' errors."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.errors import FAILED, CommandError
from buildarena_cli.options import to_read
from buildarena_cli.terminal.output import warn

if TYPE_CHECKING:
    from buildarena_benchmark import Task
    from buildarena_besiege import ImportedMachine
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

MachineFile = Annotated[
    Path,
    typer.Argument(
        help="A machine document, an action log or the game's .bsg; - reads standard input.",
        callback=to_read,
    ),
]

TaskOption = Annotated[str, typer.Option("--task", help="A built-in task's name, or a task file.")]
ControllerOption = Annotated[
    Path | None,
    typer.Option(
        help="A program (.lua) in place of the machine's own: docs/control.md.", callback=to_read
    ),
]
KeysOption = Annotated[
    Path | None,
    typer.Option(
        "--key-presses",
        help="Key presses (JSON list of time, key, hold_for) instead of the machine's own; keys of "
        "a .bsg are those that its file names.",
        callback=to_read,
    ),
]


def read_machine(file: Path, controller: Path | None = None) -> Machine:
    """Return the machine of a file, and print ignored parts to standard error.

    Args:
        file: A machine file of the game's, a machine document or an action log.
        controller: A program in place of the machine's own.

    Raises:
        OSError: A file cannot be read.
        BesiegeError: The machine file is invalid.
        DocumentError: The format is unknown, the document is invalid, or an action is refused.
        ValueError: The program is too long.
    """
    return controlled(read_imported(file).machine, controller)


def controlled(machine: Machine, program: Path | None) -> Machine:
    """Return a copy of a machine that a program controls; the machine itself without one."""
    if program is None:
        return machine
    return machine.with_controller(program.read_text(encoding="utf-8"))


def read_imported(file: Path) -> ImportedMachine:
    """Return the machine of a file with its ignored parts; see `read_machine`."""
    from buildarena_besiege import read_any_machine

    data = sys.stdin.buffer.read() if str(file) == "-" else file.read_bytes()
    imported = read_any_machine(data, where=str(file))
    for remark in imported.not_understood:
        warn(f"{file}: {remark}")
    return imported


def resolve_task(name: str) -> Task:
    """Return a built-in task, or the one in a file; see `buildarena.known_tasks`."""
    from buildarena.known_tasks import resolve_task as resolve

    return resolve(name)


def film(machine: Machine, task: Task, rollout: Trajectory, video: Path) -> None:
    """Draw a trial into a film or pictures."""
    from buildarena_simulation.render.film import write_film

    with progress_bar(f"drawing {video.name}") as on_progress:
        write_film(machine, task.scenario, rollout, video, on_progress=on_progress)


@contextlib.contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """Show a bar on standard error; yield what is called with the finished share."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        row = bar.add_task(text, total=1.0)
        yield lambda share: bar.update(row, completed=share)


@contextlib.contextmanager
def report_errors() -> Iterator[None]:
    """Convert the libraries' errors to a message and an exit code."""
    from buildarena_benchmark import TaskError
    from buildarena_geometry import GeometryError
    from buildarena_simulation import BuildarenaSimulationError, TrajectoryFormatError

    expected = (
        *(CommandError, GeometryError, TaskError, TrajectoryFormatError, BuildarenaSimulationError),
        *(OSError, ValueError),
    )
    try:
        yield
    except ImportError as error:
        warn("error: pictures need `pip install buildarena-simulation[video]`")
        raise typer.Exit(FAILED) from error
    except expected as error:
        warn(f"error: {error}")
        raise typer.Exit(error.code if isinstance(error, CommandError) else FAILED) from error
