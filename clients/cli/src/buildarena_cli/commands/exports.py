"""The command ``buildarena export``: the leaderboard as a file, or jobs as a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import typer

from buildarena_cli.client import Client
from buildarena_cli.errors import USAGE, CommandError
from buildarena_cli.ids import resolve_id
from buildarena_cli.options import DEFAULT_URL, ModelsOption, TasksOption, TrackOption, UrlOption
from buildarena_cli.terminal.output import say, warn

FORMATS: Final = {".csv": "csv", ".parquet": "parquet", ".tex": "latex"}
SweepsOption = Annotated[
    list[str] | None, typer.Option("--sweep", help="Only jobs of these sweeps.")
]


def export(
    out: Annotated[
        Path, typer.Option("--out", help="File (.csv, .parquet, .tex); a folder with --dataset.")
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
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Write the leaderboard to a file, or jobs as a dataset.

    With --dataset a folder gets every job that has ended: Parquet with a card, which the
    `datasets` library loads.
    """
    if not dataset:
        of_datasets = {
            "--sweep": sweep,
            "--success-only": success_only,
            "--license": licence,
        }
        _require_none(of_datasets, "goes with --dataset only")
        _board(out, url, task=task, model=model, track=track)
        return
    _dataset(
        Client(url),
        out,
        sweeps=sweep or [],
        tasks=task or [],
        models=model or [],
        track=track,
        success_only=success_only,
        licence=(licence or "unknown").lower(),
    )


def _board(out: Path, url: str, *, track: str | None, **asked: Any) -> None:
    kind = FORMATS.get(out.suffix)
    if kind is None:
        raise CommandError(f"{out}: the name must end in {', '.join(FORMATS)}")
    client = Client(url)
    track = track or client.get("/v1/leaderboard", **asked)["track"]
    body = client.get_bytes("/v1/leaderboard/export", format=kind, track=track, **asked)
    try:
        out.write_bytes(body)
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    warn(f"Track {track}" if track else "No jobs have ended yet.")
    say(f"{out}: {len(body):,} bytes")


def _dataset(client: Client, out: Path, *, licence: str, sweeps: list[str], **filters: Any) -> None:
    from buildarena_cli.dataset.reading import Filters, Reader
    from buildarena_cli.dataset.writing import check_place, write_dataset

    check_place(out)
    chosen = Filters(sweeps=[resolve_id(client, "sweep", id_) for id_ in sweeps], **filters)
    reader = Reader(client, chosen)
    reader.check()
    counts = write_dataset(reader.jobs(), out, licence=licence)
    say(f"{out}: {counts.jobs:,} jobs ({counts.successes:,} succeeded)")


def _require_none(options: dict[str, Any], reason: str) -> None:
    used = [option for option, value in options.items() if value]
    if used:
        raise CommandError(f"{used[0]} {reason}", code=USAGE)
