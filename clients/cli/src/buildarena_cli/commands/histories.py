"""The commands for histories: what old jobs left in rows, packed into artifacts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.lazy import new_group
from buildarena_cli.options import DataOption, JsonOption
from buildarena_cli.terminal.output import print_json, say

if TYPE_CHECKING:
    from buildarena_store.jobs.histories import Histories

app = new_group("Pack what old jobs left in the database.")
MEBIBYTE = 1024 * 1024


@app.command("pack")
def pack(
    *,
    older_than_days: Annotated[
        float, typer.Option(help="Only jobs that ended so many days ago.", min=0)
    ] = 365,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only count the jobs.")] = False,
    data: DataOption = None,
    as_json: JsonOption = False,
) -> None:
    """Move journals, calls and events of old scored jobs from the database into artifacts.

    Scores, boards and transcripts stay as they are; a verification or an archive of such a job
    puts its rows back first. The service may run; broken off, the command can be given again. It
    works on the database of BUILDARENA_DATABASE_URL, or of the data folder.
    """
    older_than = timedelta(days=older_than_days)
    jobs = rows = size = 0
    with _histories(data) as histories:
        if dry_run:
            jobs = histories.waiting(older_than)
        else:
            for done in histories.pack_all(older_than):
                jobs, rows, size = jobs + done.jobs, rows + done.rows, size + done.bytes
    if as_json:
        print_json({"dry_run": dry_run, "jobs": jobs, "rows": rows, "bytes": size})
    elif dry_run:
        say(f"the histories of {jobs:,} jobs would be packed")
    else:
        say(f"packed the histories of {jobs:,} jobs: {rows:,} rows, {size / MEBIBYTE:,.1f} MiB")


@app.command("unpack")
def unpack(
    jobs: Annotated[list[str], typer.Argument(help="Ids of jobs.")],
    *,
    data: DataOption = None,
) -> None:
    """Put the rows of packed jobs back into the database."""
    with _histories(data) as histories:
        done = histories.unpack(jobs)
    say(f"{done:,} of {len(jobs):,} jobs had been packed and are as they were")


@contextmanager
def _histories(data: Path | None) -> Iterator[Histories]:
    from buildarena_cli.local.stores import opened_stores
    from buildarena_store.jobs.histories import Histories

    with opened_stores(data) as stores:
        stores.database.require_schema()
        yield Histories(stores.database, stores.artifacts)
