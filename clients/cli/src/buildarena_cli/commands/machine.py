"""`buildarena machine`: simulate and draw a machine here, without any server."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from buildarena_benchmark import (
    Score,
    Task,
    TaskError,
    builtin_tasks,
    failed_score,
    load_task,
    score,
)
from buildarena_cli.errors import FAILED, CommandError
from buildarena_cli.output import console, error_console, print_json
from buildarena_geometry import GeometryError, Machine
from buildarena_simulation import (
    ENGINES,
    BuildarenaSimulationError,
    MachineNotSimulable,
    Trajectory,
    TrajectoryFormatError,
    read_trajectory,
    simulate,
    write_trajectory,
)

app = typer.Typer(no_args_is_help=True, help="Simulate and draw machines on this computer.")

_KNOWN = (
    CommandError,
    GeometryError,
    TaskError,
    TrajectoryFormatError,
    BuildarenaSimulationError,
    OSError,
    ValueError,
)

MachineFile = Annotated[
    Path, typer.Argument(help="A machine document or an action log, JSON; - reads standard input.")
]
TaskName = Annotated[str, typer.Option("--task", help="A built-in task's name, or a task file.")]


@app.command("simulate")
def simulate_command(  # noqa: PLR0917 - the command line passes options by name
    file: MachineFile,
    task: TaskName,
    engine: Annotated[str, typer.Option(help=f"One of {', '.join(ENGINES)}.")] = ENGINES[0],
    seed: Annotated[
        int | None, typer.Option(help="Nudge the start a hair, to see whether a result is luck.")
    ] = None,
    video: Annotated[
        Path | None, typer.Option(help="Write a film (.mp4, .gif) or six pictures (.png).")
    ] = None,
    trajectory: Annotated[
        Path | None, typer.Option(help="Write the trajectory (.parquet), for `render`.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the score as JSON.")] = False,
) -> None:
    """Put a machine through a task's trial and score it."""
    with told_errors():
        chosen, machine = chosen_task(task), read_machine(file)
        rollout = _simulated(machine, chosen, engine, seed)
        if rollout is None:
            result = failed_score(chosen, machine)
        else:
            result = score(chosen, machine, rollout)
            if trajectory is not None:
                trajectory.write_bytes(write_trajectory(rollout))
            if video is not None:
                film(machine, chosen, rollout, video)
        if as_json:
            print_json(_report(chosen, result, rollout))
        else:
            console.print(_table(chosen, result, rollout))


@app.command("render")
def render_command(
    file: MachineFile,
    task: TaskName,
    trajectory: Annotated[Path, typer.Option(help="A trajectory (.parquet) of this machine.")],
    video: Annotated[Path, typer.Option(help="The film (.mp4, .gif) or pictures (.png) to write.")],
) -> None:
    """Draw a trial that was simulated before."""
    with told_errors():
        chosen, machine = chosen_task(task), read_machine(file)
        rollout = read_trajectory(trajectory.read_bytes())
        missing = [block for block in rollout.block_ids if block not in machine.blocks]
        if missing:
            raise CommandError(f"{trajectory}: block {missing[0]} is not in {file}")
        film(machine, chosen, rollout, video)


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
    try:
        text = sys.stdin.read() if str(file) == "-" else file.read_text(encoding="utf-8")
        content = json.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise CommandError(f"{file}: no JSON can be read there: {error}") from error
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
    known = builtin_tasks()
    if name in known:
        return known[name]
    if Path(name).exists():
        return load_task(Path(name))
    raise CommandError(f"no task {name!r}; there are {', '.join(known)}, or name a task file")


def _simulated(machine: Machine, task: Task, engine: str, seed: int | None) -> Trajectory | None:
    with _progress() as bar:
        row = bar.add_task(f"simulating on {engine}", total=1.0)
        try:
            return simulate(
                machine,
                task.scenario,
                engine,
                seed=seed,
                on_progress=lambda done: bar.update(row, completed=done),
            )
        except MachineNotSimulable as failure:
            error_console.print(f"not simulated: {failure.reason}")
            return None


def film(machine: Machine, task: Task, rollout: Trajectory, video: Path) -> None:
    """Draws a trial into a film or pictures."""
    from buildarena_simulation.render.film import write_film

    with _progress() as bar:
        row = bar.add_task(f"drawing {video.name}", total=1.0)
        write_film(
            machine,
            task.scenario,
            rollout,
            video,
            on_progress=lambda done: bar.update(row, completed=done),
        )


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description:<24}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=error_console,
        transient=True,
    )


def _report(task: Task, result: Score, rollout: Trajectory | None) -> dict[str, Any]:
    return {
        "task": task.name,
        "task_version": task.version,
        "engine": rollout.engine if rollout else None,
        "engine_version": rollout.engine_version if rollout else None,
        "simulation_version": rollout.simulation_version if rollout else None,
        "success": result.success,
        "indicator": result.indicator,
        "indicator_name": task.indicator.name,
        "indicator_unit": task.indicator.unit,
        "flags": list(result.flags),
        "metrics": dict(result.metrics),
        "breaks": [
            {"time_s": event.time_s, "joint": event.joint, "kind": event.kind}
            for event in (rollout.breaks if rollout else ())
        ],
    }


def _table(task: Task, result: Score, rollout: Trajectory | None) -> Table:
    engine = f" on {rollout.engine} {rollout.engine_version}" if rollout else ""
    table = Table(title=escape(f"{task.title}{engine}"), title_justify="left", show_header=False)
    table.add_row("verdict", "success" if result.success else "failure")
    unit = "" if task.indicator.unit == "1" else f" {task.indicator.unit}"
    table.add_row(task.indicator.name, f"{result.indicator:,.2f}{unit}")
    if result.flags:
        table.add_row("flags", ", ".join(result.flags))
    for name, value in result.metrics.items():
        table.add_row(name, "-" if value is None else str(value))
    return table


@contextlib.contextmanager
def told_errors() -> Iterator[None]:
    """Turns the rooms' errors into one message and an exit code."""
    try:
        yield
    except ImportError as error:
        error_console.print("error: pictures need `pip install buildarena-simulation[video]`")
        raise typer.Exit(FAILED) from error
    except _KNOWN as error:
        error_console.print(f"error: {error}", markup=False, soft_wrap=True)
        raise typer.Exit(FAILED) from error
