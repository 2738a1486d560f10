"""The commands ``buildarena admin``, for operators of a service."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import typer

from buildarena_cli.commands import backups, keys, service_status, worker
from buildarena_cli.errors import CommandError
from buildarena_cli.options import PASSED_ON, DataOption, new_group, printed_by
from buildarena_cli.terminal.output import print_line

app = new_group("Keys, workers, backups and the database of a service.")
app.command()(service_status.status)
app.command()(service_status.logs)
app.add_typer(keys.app, name="key")
app.command(context_settings=PASSED_ON)(worker.worker)
app.command()(backups.backup)
app.command()(backups.restore)
app.command()(worker.migrate)
app.command()(worker.roles)

MEBIBYTE = 1024 * 1024


def _show(done: dict[str, Any]) -> None:
    would = "would be " if done["dry_run"] else ""
    print_line(
        f"{done['in_use']:,} artifacts are referred to, {done['young']:,} more are too new to judge"
    )
    for verb in ("trashed", "deleted"):
        print_line(f"{done[verb]:,} {would}{verb} ({done[f'{verb}_bytes'] / MEBIBYTE:,.1f} MiB)")
    if done["taken_back"]:
        print_line(f"{done['taken_back']:,} {would}taken back: something refers to them again")


@app.command("gc")
@printed_by(_show)
def collect(
    *,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only report what would be done.")
    ] = False,
    keep_days: Annotated[
        float,
        typer.Option(
            "--grace-days",
            help="Days an unreferenced artifact is kept before it moves to the trash, and again "
            "before it is deleted (total: twice this value).",
            min=1,
        ),
    ] = 7,
    data: DataOption = None,
) -> Any:
    """Remove artifacts that nothing refers to.

    They go to the trash, and are deleted by a later call; whatever is referred to again meanwhile
    comes back. The service may run; it is that of BUILDARENA_DATABASE_URL, or of the data folder.
    """
    from datetime import timedelta

    from buildarena_backend.artifacts.garbage_collector import GarbageCollector
    from buildarena_cli.local.stores import opened_stores

    with opened_stores(data) as stores:
        stores.database.require_schema()
        keep = timedelta(days=keep_days)
        collector = GarbageCollector(stores.database, stores.artifacts, keep=keep)
        done = collector.collect(dry_run=dry_run)
    if done is None:
        raise CommandError("a backup or another collection is under way: try again later")
    return {"dry_run": dry_run, **asdict(done)}
