"""Making a backup: one snapshot of the database, and every artifact that it refers to."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import Connection, select, text

from buildarena_backend import __version__
from buildarena_backend.artifacts.garbage_collector import LOCK, referenced
from buildarena_backend.database.tables import artifacts as artifacts_table
from buildarena_cli.backups.place import (
    ARTIFACTS,
    DUMP,
    FORMAT,
    NAME,
    BackupPlace,
    Manifest,
    copy_artifacts,
)
from buildarena_cli.backups.programs import run_program
from buildarena_cli.errors import CommandError
from buildarena_cli.local.stores import Stores


def write_backup(
    stores: Stores, place: BackupPlace, *, name: str | None, report: Callable[[str], None]
) -> tuple[Manifest, int]:
    """Make a backup, also while the service runs.

    An interrupted backup leaves no manifest, and the next one reuses the artifacts it copied.

    Args:
        name: Name of the backup; by default the time.
        report: Receives a line for each step.

    Returns:
        Its manifest, and the number of artifacts that no earlier backup had.

    Raises:
        CommandError: The name is bad or taken, or a program failed.
    """
    now = datetime.now(UTC)
    name = name or now.strftime("%Y-%m-%dT%H-%M-%SZ")
    if not NAME.fullmatch(name) or name == ARTIFACTS:
        raise CommandError(f"a backup can't be called {name!r}: use letters, digits, '.-_'")
    if name in place.names():
        raise CommandError(f"{place.location} has a backup {name!r} already")
    schema = stores.database.schema()
    if schema is None:
        raise CommandError("the database has no tables: there is nothing to back up")
    with (
        tempfile.TemporaryDirectory(prefix="buildarena-backup-") as folder,
        stores.database.engine.connect() as connection,
    ):
        dump = Path(folder) / DUMP
        # Closed at the end, and not pooled: its lock keeps what is copied from being collected.
        connection.detach()
        connection.execute(text("SELECT pg_advisory_lock_shared(:key)"), {"key": LOCK})
        connection.commit()
        connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY"))
        snapshot = connection.execute(text("SELECT pg_export_snapshot()")).scalar_one()
        report("dumping the database")
        arguments = ["--format=custom", "--no-owner", "--no-privileges"]
        run_program("pg_dump", stores.url, *arguments, f"--snapshot={snapshot}", f"--file={dump}")
        sizes = _sizes(connection)
        connection.rollback()
        place.send(name, dump)
        report(f"copying the new ones of {len(sizes):,} artifacts")
        stored, missing, copied = copy_artifacts(stores.artifacts, place.artifacts, sizes)
        with dump.open("rb") as opened:
            dump_sha256 = hashlib.file_digest(opened, "sha256").hexdigest()
    manifest = Manifest(
        name=name,
        format=FORMAT,
        version=__version__,
        schema=schema,
        created_at=now.isoformat(timespec="seconds"),
        dump_sha256=dump_sha256,
        sizes=stored,
        missing=list(missing),
    )
    place.finish(manifest)
    return manifest, copied


def _sizes(connection: Connection) -> dict[str, int | None]:
    """Return the sizes of all artifacts that the database refers to, by hash; None if unknown."""
    query = select(artifacts_table.c.hash, artifacts_table.c.size)
    noted = {row.hash: row.size for row in connection.execute(query)}
    return {digest: noted.get(digest) for digest in referenced(connection)}
