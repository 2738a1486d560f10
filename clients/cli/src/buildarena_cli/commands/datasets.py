"""`buildarena dataset`: machines as a dataset, made and verified on this computer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from buildarena_cli.errors import DONE, FAILED, USAGE, CommandError
from buildarena_cli.given_paths import to_read
from buildarena_cli.lazy import new_group
from buildarena_cli.machines import progress_bar, shown_errors
from buildarena_cli.options import TasksOption
from buildarena_cli.suggestions import did_you_mean
from buildarena_cli.terminal.output import say, warn

app = new_group("Make and verify datasets of machines, without a service.")
SIMULATOR: Final = "mujoco"
"""The faster engine."""

ProcessesOption = Annotated[
    int | None,
    typer.Option("--processes", help="How many; one for each core if left out.", min=1, max=256),
]


@app.command("machines")
def make(
    out: Annotated[Path, typer.Option("--out", help="A new folder.")],
    *,
    count: Annotated[
        int, typer.Option("--count", help="How many machines.", min=1, max=10_000_000)
    ] = 10_000,
    seed: Annotated[int, typer.Option("--seed", help="Draws everything.", min=0)] = 0,
    processes: ProcessesOption = None,
    simulator: Annotated[str, typer.Option("--simulator", help="mujoco or pybullet.")] = SIMULATOR,
    task: TasksOption = None,
) -> None:
    """Make a dataset of machines: drawn by a seed, tried, scored, and verified.

    The folder gets Parquet in splits with a card, which the `datasets` library loads. The same seed
    gives the same dataset in any number of processes. After an interruption the same command goes
    on where it was.
    """
    from buildarena_cli.dataset.machines.drawing import drawable_tasks
    from buildarena_cli.dataset.machines.making import Plan, make_machines
    from buildarena_simulation import require_engine

    with shown_errors():
        require_engine(simulator)
        choices = drawable_tasks()
        for name in task or []:
            if name not in choices:
                raise CommandError(
                    f"no machines are drawn for task {name!r}; they are for {', '.join(choices)}"
                    f"{did_you_mean(name, choices)}",
                    code=USAGE,
                )
        tasks = tuple(name for name in choices if not task or name in task)
        plan = Plan(seed=seed, tasks=tasks, simulator=simulator)
        with progress_bar() as bar:
            row = bar.add_task(f"{count:,} machines", total=1.0)
            counts = make_machines(
                plan,
                out,
                count=count,
                processes=processes,
                on_progress=lambda done: bar.update(row, completed=done),
            )
    say(
        f"{out}: {counts.total['machines']:,} machines ({counts.total['successes']:,} succeed), "
        f"{counts.retried:,} simulated twice"
    )


@app.command("verify")
def verify(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a dataset of machines.", callback=to_read)
    ],
    *,
    processes: ProcessesOption = None,
) -> None:
    """Make every row of a dataset again, trials included; exit code 1 if one differs."""
    from buildarena_cli.dataset.machines.crew import Crew
    from buildarena_cli.dataset.machines.repeating import verified
    from buildarena_cli.dataset.machines.trying import working

    rows = wrong = 0
    with shown_errors(), Crew(working, processes) as crew:
        for name, problems in verified(folder, crew):
            rows += 1
            wrong += bool(problems)
            if problems:
                warn(f"{name}: {'; '.join(problems)}")
    say(f"{folder}: {rows:,} machines made again, {wrong:,} differ")
    raise typer.Exit(FAILED if wrong else DONE)
