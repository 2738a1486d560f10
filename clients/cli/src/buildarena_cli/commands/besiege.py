"""`buildarena besiege`: levels for the game Besiege, and scores of its logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.client import Client
from buildarena_cli.commands import evidence
from buildarena_cli.errors import CommandError
from buildarena_cli.exec import exec_module
from buildarena_cli.given_paths import to_read
from buildarena_cli.lazy import new_group
from buildarena_cli.machines import chosen_task, read_machine, shown_errors
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.terminal.output import (
    columns,
    emphasised,
    number,
    print_json,
    print_table,
    say,
    warn,
)

if TYPE_CHECKING:
    from buildarena_benchmark import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

app = new_group("Play machines in the game Besiege.")
app.add_typer(evidence.app, name="evidence")


@app.command("level")
def level(
    task: Annotated[str, typer.Argument(help="A built-in task's name, or a task file.")],
    out: Annotated[Path, typer.Option(help="The level file (.blv) to write.")],
) -> None:
    """Write the level of a task's terrain, to be opened in the game's level editor."""
    from buildarena_besiege import level_file

    with shown_errors():
        if out.suffix != ".blv":
            raise CommandError(f"{out}: {out.suffix or 'no'} ending; use .blv")
        chosen = chosen_task(task)
        if not chosen.scenario.terrain:
            warn(f"{chosen.name} has no terrain: the level is empty, the sandbox will do")
        out.write_bytes(level_file(chosen.scenario))
    say(str(out))


@app.command("score")
def score_log(
    log: Annotated[
        Path,
        typer.Argument(help="A log of the game: ours, or a published run's CSV.", callback=to_read),
    ],
    machine: Annotated[Path, typer.Option(help="The machine that was played.", callback=to_read)],
    task: Annotated[str, typer.Option("--task", help="A built-in task's name, or a task file.")],
    run: Annotated[
        str | None, typer.Option("--run", help="The run's id, where the log is of several.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Score a trial that was played in the game, from its log."""
    from buildarena_benchmark import score
    from buildarena_cli.commands.machine.trials import print_score, score_report

    with shown_errors():
        chosen, played = chosen_task(task), read_machine(machine)
        text = log.read_bytes().decode("utf-8-sig", "replace")
        trajectory = _trajectory(text, played, chosen, where=str(log), run=run)
        result = score(chosen, played, trajectory)
        if as_json:
            print_json(score_report(chosen, result, trajectory))
        else:
            print_score(chosen, result, trajectory)


def _trajectory(
    text: str, machine: Machine, task: Task, *, where: str, run: str | None
) -> Trajectory:
    """The trajectory of a log, whose kind is recognised by its content."""
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


@app.command("calibrate")
def calibrate(
    *,
    defaults: Annotated[
        bool,
        typer.Option("--defaults", help="Take the published runner's positions, ask nothing."),
    ] = False,
    only_try: Annotated[
        bool, typer.Option("--try", help="Only try the calibration that is there.")
    ] = False,
    path: Annotated[
        bool,
        typer.Option("--path", help="Record the clicks from the game's title to its level."),
    ] = False,
) -> None:
    """Find out where to click in this machine's game, and try it."""
    chosen = {"--defaults": defaults, "--try": only_try, "--path": path}
    options = [option for option, wanted in chosen.items() if wanted]
    exec_module([*RUNNER, "calibrate", *options])


@app.command("doctor")
def doctor(*, as_json: JsonOption = False) -> None:
    """Show what this machine lacks to play the game; the exit code is 1 when anything does."""
    exec_module([*RUNNER, "doctor", *(["--json"] if as_json else [])])


@app.command("first-evening")
def first_evening(
    *,
    out: Annotated[
        Path, typer.Option(help="Folder of the evening; steps that are done in it stay done.")
    ] = Path("first-evening"),
    steps: Annotated[
        str, typer.Option(help="Only these steps, with commas between their names.")
    ] = "",
    repeats: Annotated[
        int, typer.Option(help="How often each of the expert's machines is played.")
    ] = 3,
) -> None:
    """Try this machine's game out step by step, and pack what it shows into one file.

    A step that fails is noted, with its picture, and the next one goes on. After an interruption
    the same command continues where it stopped; failed steps are tried again.
    """
    options = ["--out", str(out), "--steps", steps, "--repeats", str(repeats)]
    exec_module([*RUNNER, "first-evening", *options])


@app.command("agreement")
def show_agreement(
    track: Annotated[
        str | None, typer.Option(help="A track of the game; the first there is if left out.")
    ] = None,
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show how far our engines say the same as the game, task by task."""
    client = Client(url)
    if track is None:
        known = client.get("/v1/leaderboard")["tracks"]
        track = next((name for name in known if "/besiege-" in name), None)
        if track is None:
            raise CommandError("no job was scored in the game yet, so there is nothing to compare")
    agreement = client.get("/v1/leaderboard/agreement", track=track)
    if as_json:
        print_json(agreement)
        return
    rows = [
        (
            row["task"],
            f"{row['engine']} ({row['simulation_version']})",
            str(row["trials"]),
            f"{row['same_verdict']:.0%} ({row['low']:.0%} to {row['high']:.0%})",
            number(row["kappa"], 2),
            "" if row["near"] is None else f"{row['near']:.0%}",
        )
        for row in agreement["rows"]
    ]
    heads = ("task", "engine", "trials", "same verdict", "kappa", "indicator within a quarter")
    print_table(columns(*heads), rows, title=emphasised(str(agreement["track"])))


RUNNER = ("buildarena_simworker_besiege",)
"""The program that knows this machine's game."""
