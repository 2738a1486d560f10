"""The commands backup and restore."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.errors import PARTIAL, CommandError
from buildarena_cli.options import DataOption, JsonOption, to_read_or_url
from buildarena_cli.terminal.output import print_json, say

if TYPE_CHECKING:
    from buildarena_cli.backups.place import BackupPlace

MEBIBYTE = 1024 * 1024


def backup(
    place: Annotated[
        str, typer.Argument(help="Folder of the backups, or a URL such as s3://bucket/prefix.")
    ],
    *,
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the backup; the time by default.")
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
    as_json: JsonOption = False,
) -> None:
    """Back up the database and its artifacts.

    The service may run meanwhile: a backup is one moment of it. Several backups in one place share
    their artifacts. Without BUILDARENA_DATABASE_URL, it is the service of the data folder.
    The exit code is 3 when artifacts were missing already, or --check finds a damaged one; the next
    backup copies that again.
    """
    from buildarena_cli.backups.writing import write_backup
    from buildarena_cli.local.stores import opened_stores

    with _sayable():
        where = _place(place)
        if listed:
            _list(where, as_json=as_json)
            return
        if check:
            _check(where, name, as_json=as_json)
            return
        with opened_stores(data) as stores:
            report = _reporter(as_json)
            backup = write_backup(
                stores.database, stores.url, stores.artifacts, where, name=name, report=report
            )
    manifest = backup.manifest
    if as_json:
        print_json({"name": backup.name, "copied": backup.copied, **asdict(manifest)})
    else:
        say(
            f"backup {backup.name}: {manifest.artifacts:,} artifacts, "
            f"{manifest.artifact_bytes / MEBIBYTE:,.1f} MiB, {backup.copied:,} of them copied"
        )
        for digest in manifest.missing:
            say(f"missing or damaged in the store: {digest}")
    if manifest.missing:
        raise typer.Exit(PARTIAL)


def restore(
    place: Annotated[
        str, typer.Argument(help="Folder or URL of the backups.", callback=to_read_or_url)
    ],
    *,
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the backup; the newest by default.")
    ] = None,
    allow_missing: Annotated[
        bool,
        typer.Option(
            "--allow-missing-artifacts",
            help="Restore the rest if artifacts are lost or damaged.",
        ),
    ] = False,
    data: DataOption = None,
    as_json: JsonOption = False,
) -> None:
    """Restore a backup into an empty database.

    The database is that of BUILDARENA_DATABASE_URL, or a new one in the data folder. Broken off,
    the command can be given again. Jobs that were running at the backup's moment continue from
    their journals. The exit code is 3 when something of the backup is lost, which is named.
    """
    from buildarena_cli.backups.restoring import restore_backup
    from buildarena_cli.local.stores import opened_stores

    with _sayable():
        where = _place(place)
        chosen = _select(where, name)
        with opened_stores(data, new=True) as stores:
            restored = restore_backup(
                stores.database,
                stores.url,
                stores.artifacts,
                where,
                chosen,
                allow_missing=allow_missing,
                report=_reporter(as_json),
            )
    manifest, lost = restored.manifest, restored.lost
    if as_json:
        print_json({"name": chosen, **asdict(manifest), "lost": lost})
    else:
        say(f"restored {chosen} of {manifest.made_at}: {manifest.artifacts:,} artifacts")
        for digest, uses in lost.items():
            say(f"lost: artifact {digest}, {', '.join(uses) or 'of a journal or a machine'}")
    if lost:
        raise typer.Exit(PARTIAL)


def _select(place: BackupPlace, name: str | None) -> str:
    """Return the name of an existing backup; by default the newest."""
    names = place.names()
    if not names:
        raise CommandError(f"{place.location} has no complete backup")
    chosen = name or names[-1]
    place.manifest(chosen)
    return chosen


def _check(place: BackupPlace, name: str | None, *, as_json: bool) -> None:
    from buildarena_cli.backups.restoring import check_backup

    chosen = _select(place, name)
    problems, manifest = check_backup(place, chosen), place.manifest(chosen)
    if as_json:
        print_json({"name": chosen, **asdict(manifest), "problems": problems})
    else:
        for problem in problems.values():
            say(problem)
        verdict = f"{len(problems):,} artifacts are not" if problems else "every byte is"
        say(f"backup {chosen} of {manifest.made_at}: {verdict} as it was written")
    if problems:
        raise typer.Exit(PARTIAL)


def _reporter(quiet: bool) -> Callable[[str], None]:
    return (lambda _: None) if quiet else (lambda line: say(f"· {line}"))


def _place(location: str) -> BackupPlace:
    from buildarena_backend.errors import StartupError
    from buildarena_backend.settings import load_settings
    from buildarena_cli.backups.place import BackupPlace

    try:
        return BackupPlace(location, load_settings().artifact_options)
    except StartupError as error:
        raise CommandError(str(error)) from error


@contextmanager
def _sayable() -> Iterator[None]:
    """Convert errors of the place of backups to messages of the command."""
    from obstore.exceptions import BaseError

    try:
        yield
    except (BaseError, OSError) as error:
        raise CommandError(str(error).splitlines()[0]) from error


def _list(place: BackupPlace, *, as_json: bool) -> None:
    backups = {name: place.manifest(name) for name in place.names()}
    if as_json:
        print_json([{"name": name, **asdict(manifest)} for name, manifest in backups.items()])
        return
    for name, entry in backups.items():
        say(f"{name}  {entry.artifacts:,} artifacts  {entry.artifact_bytes / MEBIBYTE:,.1f} MiB")
    if not backups:
        say(f"{place.location} has no complete backup")
