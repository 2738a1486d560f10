"""The command ``buildarena export``: the leaderboard as a file, or jobs as a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import typer

from buildarena_cli.errors import USAGE, CommandError
from buildarena_cli.ids import resolve_id
from buildarena_cli.options import (
    ModelsOption,
    ServiceOption,
    SweepsOption,
    TasksOption,
    TrackOption,
)
from buildarena_cli.terminal.output import print_line, warn
from buildarena_client.client import Client

FORMATS: Final = {".csv": "csv", ".parquet": "parquet", ".tex": "latex"}


def export(
    out: Annotated[
        Path, typer.Option(help="File (.csv, .parquet, .tex); a folder with --dataset.")
    ],
    *,
    dataset: Annotated[
        bool, typer.Option("--dataset", help="Jobs with their transcripts, as a dataset.")
    ] = False,
    task: TasksOption = None,
    model: ModelsOption = None,
    track: TrackOption = None,
    sweep: SweepsOption = None,
    success_only: Annotated[
        bool, typer.Option("--success-only", help="Only jobs that succeeded.")
    ] = False,
    licence: Annotated[
        str | None,
        typer.Option("--license", help="Licence of the content by models, agents and people."),
    ] = None,
    client: ServiceOption,
) -> None:
    """Write the leaderboard to a file, or jobs as a dataset.

    With --dataset a folder gets every job that has ended: Parquet with a card, which the
    `datasets` library loads.
    """
    if not dataset:
        options = {"--sweep": sweep, "--success-only": success_only, "--license": licence}
        used = [option for option, value in options.items() if value]
        if used:
            raise CommandError(f"{used[0]} goes with --dataset only", code=USAGE)
        _board(client, out, task=task, model=model, track=track)
        return
    from buildarena_cli.dataset.reading import read_jobs
    from buildarena_cli.dataset.writing import write_dataset

    jobs = read_jobs(
        client,
        sweep=[resolve_id(client, "sweep", id_) for id_ in sweep or ()] or None,
        task=task,
        model=model,
        track=track,
        outcome="success" if success_only else None,
    )
    counts = write_dataset(jobs, out, licence=(licence or "unknown").lower())
    print_line(f"{out}: {counts.jobs:,} jobs ({counts.successes:,} succeeded)")


def _board(client: Client, out: Path, *, track: str | None, **asked: Any) -> None:
    kind = FORMATS.get(out.suffix)
    if kind is None:
        raise CommandError(f"{out}: the name must end in {', '.join(FORMATS)}")
    track = track or client.leaderboard(**asked)["track"]
    body = client.get_bytes("/v1/leaderboard/export", format=kind, track=track, **asked)
    try:
        out.write_bytes(body)
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    warn(f"Track {track}" if track else "No jobs have ended yet.")
    print_line(f"{out}: {len(body):,} bytes")
