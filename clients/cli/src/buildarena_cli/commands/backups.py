"""The commands backup and restore."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.errors import DONE, PARTIAL, CommandError
from buildarena_cli.options import DataOption, printed_by, settings_with
from buildarena_cli.terminal.output import print_line, warn

if TYPE_CHECKING:
    from buildarena_cli.backups.place import BackupPlace

MEBIBYTE = 1024 * 1024
PlaceArgument = Annotated[
    str, typer.Argument(help="Folder of the backups, or a URL such as s3://bucket/prefix.")
]


def _show(answer: Any) -> None:
    """Print what a command made or found: lines about artifacts below each backup."""
    for made in answer if isinstance(answer, list) else [answer]:
        copied = f", {made['copied']:,} of them copied" if "copied" in made else ""
        print_line(
            f"{made['name']}, of {made['created_at']}: {made['artifacts']:,} artifacts, "
            f"{made['artifact_bytes'] / MEBIBYTE:,.1f} MiB{copied}"
        )
        for digest in made["missing"]:
            print_line(f"missing or damaged in the store: {digest}")
        for digest, uses in made.get("lost", {}).items():
            print_line(f"lost: artifact {digest}, {', '.join(uses) or 'of a journal or a machine'}")
        for problem in made.get("problems", {}).values():
            print_line(problem)
        if made.get("problems") == {}:
            print_line("Every byte is as it was written.")


def _code(answer: Any) -> int:
    """3 where something of a backup is lost; a list of backups says that without it."""
    if isinstance(answer, list):
        return DONE
    lost = [answer.get(name) for name in ("missing", "lost", "problems")]
    return PARTIAL if any(lost) else DONE


@printed_by(_show, code=_code)
def backup(
    place: PlaceArgument,
    *,
    name: Annotated[
        str | None, typer.Option(help="Name of the backup; the time by default.")
    ] = None,
    listed: Annotated[bool, typer.Option("--list", help="Only list the existing backups.")] = False,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Read every byte of the newest complete backup, or of --name, and compare hashes.",
        ),
    ] = False,
    data: DataOption = None,
) -> Any:
    """Back up the database and its artifacts.

    The service may run meanwhile: a backup is one moment of it. Several backups in one place share
    their artifacts. Without BUILDARENA_DATABASE_URL, it is the service of the data folder.
    The exit code is 3 when artifacts were missing already, or --check finds a damaged one; the next
    backup copies that again.
    """
    from buildarena_cli.backups.restoring import check_backup
    from buildarena_cli.backups.writing import write_backup
    from buildarena_cli.local.stores import opened_stores

    with _place(place) as where:
        if listed:
            return [where.manifest(each).summary() for each in where.names()]
        if check:
            manifest = where.manifest(name)
            return {**manifest.summary(), "problems": check_backup(where, manifest)}
        with opened_stores(data) as stores:
            manifest, copied = write_backup(stores, where, name=name, report=_report)
        return {**manifest.summary(), "copied": copied}


@printed_by(_show, code=_code)
def restore(
    place: PlaceArgument,
    *,
    name: Annotated[
        str | None, typer.Option(help="Name of the backup; the newest by default.")
    ] = None,
    allow_missing: Annotated[
        bool,
        typer.Option(
            "--allow-missing-artifacts", help="Restore the rest if artifacts are lost or damaged."
        ),
    ] = False,
    data: DataOption = None,
) -> Any:
    """Restore a backup into an empty database.

    The database is that of BUILDARENA_DATABASE_URL, or a new one in the data folder. Broken off,
    the command can be given again. Jobs that were running at the backup's moment continue from
    their journals. The exit code is 3 when something of the backup is lost, which is named.
    """
    from buildarena_cli.backups.restoring import restore_backup
    from buildarena_cli.local.stores import opened_stores

    with _place(place) as where:
        manifest = where.manifest(name)
        with opened_stores(data, new=True) as stores:
            lost = restore_backup(
                stores, where, manifest, allow_missing=allow_missing, report=_report
            )
        return {**manifest.summary(), "lost": lost}


def _report(line: str) -> None:
    warn(f"· {line}")


@contextmanager
def _place(location: str) -> Iterator[BackupPlace]:
    """Yield the place of backups, whose errors become messages of the command."""
    from obstore.exceptions import BaseError

    from buildarena_cli.backups.place import BackupPlace

    try:
        yield BackupPlace(location, settings_with().artifact_options)
    except (BaseError, OSError) as error:
        raise CommandError(str(error).splitlines()[0]) from error
