"""`buildarena besiege`: levels for the game Besiege, and scores of its logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from buildarena_cli.errors import CommandError
from buildarena_cli.exec import exec_module
from buildarena_cli.machines import TaskOption, read_machine, report_errors, resolve_task
from buildarena_cli.options import PASSED_ON, JsonOption, new_group, to_read
from buildarena_cli.terminal.output import print_line, warn

if TYPE_CHECKING:
    from buildarena_benchmark import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

app = new_group("Play machines in the game Besiege.")


@app.command("level")
@report_errors()
def level(
    task: Annotated[str, typer.Argument(help="A built-in task's name, or a task file.")],
    out: Annotated[Path, typer.Option(help="The level file (.blv) to write.")],
) -> None:
    """Write the level of a task's terrain, to be opened in the game's level editor."""
    from buildarena_besiege import level_file

    if out.suffix != ".blv":
        raise CommandError(f"{out}: {out.suffix or 'no'} ending; use .blv")
    chosen = resolve_task(task)
    if not chosen.scenario.terrain:
        warn(f"{chosen.name} has no terrain: the level is empty, the sandbox will do")
    out.write_bytes(level_file(chosen.scenario))
    print_line(str(out))


@app.command("score")
@report_errors()
def score_log(
    log: Annotated[
        Path,
        typer.Argument(help="A log of the game: ours, or a published run's CSV.", callback=to_read),
    ],
    machine: Annotated[Path, typer.Option(help="The machine that was played.", callback=to_read)],
    task: TaskOption,
    run: Annotated[
        str | None, typer.Option(help="Id of the run, if the log contains several.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Score a trial that was played in the game, from its log."""
    from buildarena_benchmark import score
    from buildarena_cli.commands.machine.trials import show_score

    chosen, played = resolve_task(task), read_machine(machine)
    text = log.read_bytes().decode("utf-8-sig", "replace")
    trajectory = _trajectory(text, played, chosen, where=str(log), run=run)
    show_score(chosen, score(chosen, played, trajectory), trajectory, as_json=as_json)


def _trajectory(
    text: str, machine: Machine, task: Task, *, where: str, run: str | None
) -> Trajectory:
    """Return the trajectory of a log, whose kind is recognised by its content."""
    from buildarena_besiege import (
        GameLog,
        looks_published,
        published_trajectory,
        run_ids,
        trajectory_of,
    )

    runs = run_ids(text)
    if not runs:
        if looks_published(text):
            return published_trajectory(text, machine, task.scenario)
        raise CommandError(f"{where}: neither a log of ours nor one of the published runner")
    if run is None and len(runs) > 1:
        raise CommandError(f"{where}: of {len(runs)} runs; name one by --run: {', '.join(runs)}")
    if run is not None and run not in runs:
        raise CommandError(f"{where}: no run {run!r}; there are {', '.join(runs)}")
    log = GameLog(run or runs[0])
    log.read(text)
    return trajectory_of(log, machine, task.scenario, game="unknown", mod="unknown")


RUNNER: Final = "buildarena_simworker.besiege"
"""The program that knows this machine's game, and its own options."""


@app.command("calibrate", context_settings=PASSED_ON, add_help_option=False)
def calibrate(context: typer.Context) -> None:
    """Find out where to click in this machine's game, and try it."""
    exec_module([RUNNER, "calibrate", *context.args])


@app.command("doctor", context_settings=PASSED_ON, add_help_option=False)
def doctor(context: typer.Context) -> None:
    """Show what this machine lacks to play the game; the exit code is 1 when anything does."""
    exec_module([RUNNER, "doctor", *context.args])
