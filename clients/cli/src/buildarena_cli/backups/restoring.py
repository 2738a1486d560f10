"""Restoring a backup into an empty database: artifacts first, then the database in one piece."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sqlalchemy import inspect, select

from buildarena_backend.database.database import Database
from buildarena_backend.database.migrations import known_schemas
from buildarena_backend.database.tables import job_artifacts
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError
from buildarena_cli.backups.place import AT_ONCE, DUMP, BackupPlace, Manifest, copy_artifacts
from buildarena_cli.backups.programs import run_program
from buildarena_cli.errors import CommandError
from buildarena_cli.local.stores import Stores


def restore_backup(
    stores: Stores,
    place: BackupPlace,
    manifest: Manifest,
    *,
    allow_missing: bool,
    report: Callable[[str], None],
) -> dict[str, list[str]]:
    """Restore a backup. An interrupted one leaves the database empty and can be repeated.

    Args:
        stores: An empty database, and the store that receives the artifacts; existing ones remain.
        allow_missing: Whether to continue if artifacts are lost or damaged.
        report: Receives a line for each step.

    Returns:
        Names of artifacts that could not be restored, as ``JOB/NAME``, by hash.

    Raises:
        CommandError: The database is not empty, the backup is damaged or of a newer program.
    """
    name = manifest.name
    if manifest.schema not in known_schemas():
        raise CommandError(
            f"backup {name} was made by version {manifest.version}, with the schema "
            f"{manifest.schema}, which this program does not know: use that version or a newer one"
        )
    if inspect(stores.database.engine).get_table_names():
        raise CommandError("the database is not empty: restore into an empty one")
    with tempfile.TemporaryDirectory(prefix="buildarena-restore-") as folder:
        dump = Path(folder) / DUMP
        report("checking the backup")
        place.fetch(manifest, dump)
        report(f"copying {len(manifest.sizes):,} artifacts")
        _, lost, _ = copy_artifacts(place.artifacts, stores.artifacts, manifest.sizes)
        if lost and not allow_missing:
            raise CommandError(
                f"{len(lost):,} of backup {name}'s {len(manifest.sizes):,} artifacts are lost or "
                f"damaged, the first: {next(iter(lost.values()))}. The database was not touched; "
                "--allow-missing-artifacts restores the rest"
            )
        report("restoring the database")
        arguments = ["--no-owner", "--no-privileges", "--exit-on-error", "--single-transaction"]
        run_program("pg_restore", stores.url, *arguments, str(dump))
    stores.database.migrate()
    return _names(stores.database, [*manifest.missing, *lost])


def _names(database: Database, lost: Iterable[str]) -> dict[str, list[str]]:
    """Return the artifacts' names, as ``JOB/NAME``, by their hashes."""
    names: dict[str, list[str]] = {digest: [] for digest in lost}
    query = select(job_artifacts).where(job_artifacts.c.hash.in_(list(names)))
    with database.transaction() as connection:
        for row in connection.execute(query.order_by(job_artifacts.c.job_id)):
            names[row.hash].append(f"{row.job_id}/{row.name}")
    return names


def check_backup(place: BackupPlace, manifest: Manifest) -> dict[str, str]:
    """Read a backup: its dump, and every artifact.

    Damaged artifacts are moved to the place's trash, so that the next backup copies them again.

    Returns:
        Errors of artifacts by hash, including those that were missing when the backup was made.

    Raises:
        CommandError: The dump is damaged.
    """
    with tempfile.TemporaryDirectory(prefix="buildarena-check-") as folder:
        place.fetch(manifest, Path(folder) / DUMP)

    def problem_of(digest: str) -> str | None:
        try:
            place.artifacts.get(digest)
        except ArtifactMissingError as error:
            return str(error)
        except ArtifactDamagedError as error:
            place.artifacts.trash(digest)
            return str(error)
        return None

    with ThreadPoolExecutor(AT_ONCE) as pool:
        problems = zip(manifest.sizes, pool.map(problem_of, manifest.sizes), strict=True)
        found = {digest: problem for digest, problem in problems if problem}
    missing = {
        digest: f"artifact {digest} was missing when the backup was made"
        for digest in manifest.missing
    }
    return missing | found
