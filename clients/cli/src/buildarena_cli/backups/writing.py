"""Making a backup: one snapshot of the database, and every artifact that it refers to."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from sqlalchemy import Connection, select, text

from buildarena_backend import __version__
from buildarena_backend.artifacts.garbage_collector import LOCK, referenced
from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import artifacts as artifacts_table
from buildarena_cli.backups.place import (
    DUMP,
    FORMAT,
    LIST,
    NAME,
    BackupPlace,
    Manifest,
    copy_artifacts,
)
from buildarena_cli.backups.programs import run_program
from buildarena_cli.errors import CommandError

CHUNK_BYTES: Final = 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """Result of making a backup.

    Attributes:
        copied: Number of artifacts that no earlier backup had.
    """

    name: str
    manifest: Manifest
    copied: int


def write_backup(
    database: Database,
    url: str,
    artifacts: ArtifactStore,
    place: BackupPlace,
    *,
    name: str | None = None,
    report: Callable[[str], None],
) -> Written:
    """Make a backup, also while the service runs.

    An interrupted backup leaves no manifest, and the next one reuses the artifacts it copied.

    Args:
        url: URL of the database.
        name: Name of the backup; by default the time.
        report: Receives a line for each step.

    Raises:
        CommandError: The name is bad or taken, or a program failed.
    """
    now = datetime.now(UTC)
    name = name or now.strftime("%Y-%m-%dT%H-%M-%SZ")
    if not NAME.fullmatch(name) or name == "artifacts":
        raise CommandError(f"a backup can't be called {name!r}: use letters, digits, '.-_'")
    if name in place.names():
        raise CommandError(f"{place.location} has a backup {name!r} already")
    schema = database.schema()
    if schema is None:
        raise CommandError("the database has no tables: there is nothing to back up")
    with tempfile.TemporaryDirectory(prefix="buildarena-backup-") as folder:
        dump = Path(folder) / DUMP
        with database.engine.connect() as connection:
            connection.execute(
                text("SELECT pg_advisory_lock_shared(:key)"), {"key": LOCK}
            )  # until the connection closes: nothing that we copy is collected
            connection.commit()
            try:
                connection.execute(
                    text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")
                )
                snapshot = connection.execute(text("SELECT pg_export_snapshot()")).scalar_one()
                report("dumping the database")
                arguments = ["--format=custom", "--no-owner", "--no-privileges"]
                run_program("pg_dump", url, *arguments, f"--snapshot={snapshot}", f"--file={dump}")
                sizes = _sizes(connection)
                connection.rollback()
                place.send(f"{name}/{DUMP}", dump)
                report(f"copying the new ones of {len(sizes):,} artifacts")
                copied = copy_artifacts(artifacts, place.artifacts, sizes)
            finally:
                connection.rollback()
                connection.execute(text("SELECT pg_advisory_unlock_shared(:key)"), {"key": LOCK})
                connection.commit()
        listed = "".join(f"{digest} {size}\n" for digest, size in copied.sizes.items()).encode()
        place.write(f"{name}/{LIST}", listed)
        manifest = Manifest(
            format=FORMAT,
            version=__version__,
            schema=schema,
            made_at=now.isoformat(timespec="seconds"),
            dump_sha256=_hash_of(dump),
            list_sha256=hashlib.sha256(listed).hexdigest(),
            artifacts=len(copied.sizes),
            artifact_bytes=sum(copied.sizes.values()),
            missing=list(copied.missing),
        )
    place.finish(name, manifest)
    return Written(name=name, manifest=manifest, copied=copied.new)


def _sizes(connection: Connection) -> dict[str, int | None]:
    """Return the sizes of all artifacts that the database refers to, by hash; None if unknown."""
    query = select(artifacts_table.c.hash, artifacts_table.c.size)
    noted = {row.hash: row.size for row in connection.execute(query)}
    return {digest: noted.get(digest) for digest in referenced(connection)}


def _hash_of(file: Path) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as opened:
        while chunk := opened.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()
