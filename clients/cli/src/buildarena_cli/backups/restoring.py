"""Restoring a backup into an empty database: artifacts first, then the database in one piece."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from obstore.exceptions import BaseError
from sqlalchemy import inspect, select

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.database.database import Database
from buildarena_backend.database.migrations import known_schemas
from buildarena_backend.database.tables import job_artifacts
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError
from buildarena_cli.backups.place import AT_ONCE, DUMP, LIST, BackupPlace, Manifest, copy_artifacts
from buildarena_cli.backups.programs import run_program
from buildarena_cli.errors import CommandError


@dataclass(frozen=True, slots=True, kw_only=True)
class Restored:
    """Result of restoring a backup.

    Attributes:
        lost: Names of artifacts that could not be restored, as ``JOB/NAME``, by hash.
    """

    manifest: Manifest
    lost: Mapping[str, Sequence[str]]


def restore_backup(
    database: Database,
    url: str,
    artifacts: ArtifactStore,
    place: BackupPlace,
    name: str,
    *,
    allow_missing: bool = False,
    report: Callable[[str], None],
) -> Restored:
    """Restore a backup. An interrupted one leaves the database empty and can be repeated.

    Args:
        database: An empty database.
        url: URL of the database.
        artifacts: Store that receives the artifacts; existing ones remain.
        name: Name of the backup.
        allow_missing: Whether to continue if artifacts are lost or damaged.
        report: Receives a line for each step.

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
        report("checking the backup")
        sizes = read_list(place, name, manifest, dump)
        report(f"copying {len(sizes):,} artifacts")
        lost = copy_artifacts(place.artifacts, artifacts, sizes).missing
        if lost and not allow_missing:
            raise CommandError(
                f"{len(lost):,} of backup {name}'s {len(sizes):,} artifacts are lost or "
                f"damaged, the first: {next(iter(lost.values()))}. The database was not touched; "
                "--allow-missing-artifacts restores the rest"
            )
        report("restoring the database")
        arguments = ["--no-owner", "--no-privileges", "--exit-on-error", "--single-transaction"]
        run_program(
            "pg_restore", url, *arguments, "--dbname", str(database.engine.url.database), str(dump)
        )
    database.migrate()
    return Restored(manifest=manifest, lost=_names(database, [*manifest.missing, *lost]))


def read_list(place: BackupPlace, name: str, manifest: Manifest, dump: Path) -> dict[str, int]:
    """Return the sizes of a backup's artifacts by hash, and write its dump to a file.

    Raises:
        CommandError: The dump or the list can't be read, or is damaged.
    """
    try:
        sha256, listed = place.fetch(f"{name}/{DUMP}", dump), place.read(f"{name}/{LIST}")
    except (BaseError, OSError) as error:
        raise CommandError(f"backup {name} can't be read: {error}") from error
    for file, actual, expected in (
        (DUMP, sha256, manifest.dump_sha256),
        (LIST, hashlib.sha256(listed).hexdigest(), manifest.list_sha256),
    ):
        if actual != expected:
            raise CommandError(
                f"{name}/{file} is damaged: its SHA-256 is {actual}, the manifest says {expected}"
            )
    return {digest: int(size) for digest, size in map(str.split, listed.decode().splitlines())}


def _names(database: Database, lost: Sequence[str]) -> dict[str, list[str]]:
    """Return the artifacts' names, as ``JOB/NAME``, by their hashes."""
    names: dict[str, list[str]] = {digest: [] for digest in lost}
    query = select(job_artifacts).where(job_artifacts.c.hash.in_(list(names)))
    with database.transaction() as connection:
        for row in connection.execute(query.order_by(job_artifacts.c.job_id)):
            names[row.hash].append(f"{row.job_id}/{row.name}")
    return names


def check_backup(place: BackupPlace, name: str) -> dict[str, str]:
    """Read a backup: its dump, its list, and every artifact.

    Damaged artifacts are moved to the place's trash, so that the next backup copies them again.

    Returns:
        Errors of artifacts by hash, including those that were missing when the backup was made.

    Raises:
        CommandError: The backup is unknown, or its dump or list is damaged.
    """
    manifest = place.manifest(name)
    with tempfile.TemporaryDirectory(prefix="buildarena-check-") as folder:
        sizes = read_list(place, name, manifest, Path(folder) / DUMP)

    def problem_of(digest: str) -> str | None:
        try:
            size = len(place.artifacts.get(digest))
        except ArtifactMissingError as error:
            return str(error)
        except ArtifactDamagedError as error:
            place.artifacts.trash(digest)
            return str(error)
        if size != sizes[digest]:
            return f"artifact {digest} has {size:,} bytes, the list says {sizes[digest]:,}"
        return None

    with ThreadPoolExecutor(AT_ONCE) as pool:
        problems = dict(zip(sizes, pool.map(problem_of, sizes), strict=True))
    missing = {
        digest: f"artifact {digest} was missing when the backup was made"
        for digest in manifest.missing
    }
    return missing | {digest: problem for digest, problem in problems.items() if problem}
