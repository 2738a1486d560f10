"""Restoring a backup into an empty database: artifacts first, then the database in one piece."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from pathlib import Path

from obstore.exceptions import BaseError
from sqlalchemy import inspect

from buildarena_cli.backups.copying import copy_artifacts
from buildarena_cli.backups.place import DUMP, LIST, BackupPlace, Manifest
from buildarena_cli.backups.programs import run_program
from buildarena_cli.errors import CommandError
from buildarena_store import ArtifactStore, Database
from buildarena_store.database import known_schemas


def restore_backup(
    database: Database,
    url: str,
    artifacts: ArtifactStore,
    place: BackupPlace,
    name: str,
    *,
    tell: Callable[[str], None],
) -> Manifest:
    """Restores a backup. Broken off, it leaves the database empty and can be done again.

    Args:
        database: An empty database.
        url: Its address.
        artifacts: Where artifacts go; what is there stays.
        place: Where the backup lies.
        name: Its name.
        tell: Gets a line for each step.

    Raises:
        CommandError: The database is not empty, the backup is damaged or of a newer program.
    """
    manifest = place.manifest(name)
    if manifest.schema not in known_schemas():
        raise CommandError(
            f"backup {name} was made by version {manifest.version}, with the schema "
            f"{manifest.schema}, which this program does not know: use that version or a newer one"
        )
    if inspect(database.engine).get_table_names():
        raise CommandError("the database is not empty: restore into an empty one")
    with tempfile.TemporaryDirectory(prefix="buildarena-restore-") as folder:
        dump = Path(folder) / DUMP
        try:
            tell("checking the backup")
            sha256, listed = place.fetch(f"{name}/{DUMP}", dump), place.read(f"{name}/{LIST}")
        except (BaseError, OSError) as error:
            raise CommandError(f"backup {name} can't be read: {error}") from error
        for what, actual, expected in (
            (DUMP, sha256, manifest.dump_sha256),
            (LIST, hashlib.sha256(listed).hexdigest(), manifest.list_sha256),
        ):
            if actual != expected:
                raise CommandError(
                    f"{name}/{what} is damaged: its SHA-256 is {actual}, "
                    f"the manifest says {expected}"
                )
        hashes = [line.split()[0] for line in listed.decode().splitlines()]
        tell(f"copying {len(hashes):,} artifacts")
        missing = copy_artifacts(place.artifacts, artifacts, hashes).missing
        if missing:
            raise CommandError(
                f"{len(missing):,} of backup {name}'s {len(hashes):,} artifacts are lost or "
                f"damaged, the first: {next(iter(missing.values()))}. The database was not touched"
            )
        tell("restoring the database")
        words = ["--no-owner", "--no-privileges", "--exit-on-error", "--single-transaction"]
        run_program(
            "pg_restore", url, *words, "--dbname", str(database.engine.url.database), str(dump)
        )
    database.migrate()
    return manifest
