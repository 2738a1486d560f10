"""Archives: a whole sweep as one ZIP file, to be kept, passed on, or imported elsewhere.

It holds every row that belongs to the sweep's jobs as JSON lines and every artifact by its hash.
An import checks ids and hashes; jobs that already exist stay as they are.
"""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Column, Connection, DateTime, Numeric, Table, func, select, text
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.exc import OperationalError, StatementError

from buildarena_store import events
from buildarena_store.artifacts import ArtifactStore
from buildarena_store.database import Database, expected_schema
from buildarena_store.errors import StoreError
from buildarena_store.jobs.job import JobKey
from buildarena_store.states import JobState, SweepState
from buildarena_store.sweeps.sweeps import Sweeps
from buildarena_store.tables import (
    artifacts,
    attempts,
    external_calls,
    job_artifacts,
    jobs,
    journal,
    rollouts,
    sweep_jobs,
    sweeps,
    tasks,
)

FORMAT: Final = 1
"""Rises with every change that older programs can't read."""
OF_JOBS: Final = (attempts, journal, external_calls, rollouts, job_artifacts)
"""Tables whose rows belong to one job."""
CHUNK: Final = 500
LARGEST_MEMBER: Final = 1 << 30
ARTIFACT_NAME = re.compile(r"artifacts/([0-9a-f]{64})")


class ArchiveError(StoreError):
    """A file is not an archive that can be imported; nothing of it was stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """The result of an import.

    Attributes:
        sweep_id: The sweep.
        jobs: Jobs it consists of.
        added: Jobs that were not there before.
    """

    sweep_id: str
    jobs: int
    added: int


def write_archive(database: Database, store: ArtifactStore, sweep_id: str, target: Path) -> None:
    """Writes a sweep with everything that belongs to it, as of one moment.

    Raises:
        UnknownIdError: There is no such sweep.
        ArtifactMissingError: The artifact store has lost something of it.
    """
    Sweeps(database).get(sweep_id)
    with (
        database.transaction() as connection,
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
        _write_rows(archive, connection, sweep_id)
        members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
        hashes = select(job_artifacts.c.hash).where(job_artifacts.c.job_id.in_(members)).distinct()
        for digest in connection.execute(hashes.order_by(job_artifacts.c.hash)).scalars():
            archive.writestr(f"artifacts/{digest}", store.get(digest))
        manifest = {
            "format": FORMAT,
            "schema": expected_schema(),
            "buildarena": version("buildarena-store"),
            "sweep": sweep_id,
            "written_at": datetime.now(UTC).isoformat(),
        }
        archive.writestr("manifest.json", json.dumps(manifest, indent=2))


def _write_rows(archive: zipfile.ZipFile, connection: Connection, sweep_id: str) -> None:
    members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
    of_jobs = {table: table.c.job_id.in_(members) for table in OF_JOBS}
    hashes = select(job_artifacts.c.hash).where(of_jobs[job_artifacts])
    played = select(jobs.c.task, jobs.c.task_version).where(jobs.c.id.in_(members))
    played_tasks = func.row(tasks.c.name, tasks.c.version).in_(played)
    conditions: dict[Table, Any] = {
        sweeps: sweeps.c.id == sweep_id,
        jobs: jobs.c.id.in_(members),
        tasks: played_tasks,
        artifacts: artifacts.c.hash.in_(hashes),
        **of_jobs,
    }
    for table, condition in conditions.items():
        query = select(table).where(condition).order_by(*table.primary_key.columns)
        with archive.open(f"rows/{table.name}.jsonl", "w") as member:
            for row in connection.execution_options(yield_per=CHUNK).execute(query):
                values = {column.name: _plain(getattr(row, column.name)) for column in table.c}
                member.write(json.dumps(values, ensure_ascii=False).encode() + b"\n")


def _plain(value: Any) -> Any:
    if isinstance(value, datetime):
        return value.isoformat()
    return str(value) if isinstance(value, Decimal) else value


def read_archive(
    database: Database, store: ArtifactStore, source: Path, *, owner: str | None = None
) -> Imported:
    """Imports a sweep: everything that is missing, or nothing.

    Jobs that had not ended come in on hold, and the sweep as paused: resuming it goes on from
    their journals.

    Args:
        database: Where its rows go.
        store: Where its artifacts go.
        source: The archive.
        owner: Id of the API key that it belongs to from now on.

    Raises:
        ArchiveError: It is damaged, was changed, or comes from another version.
    """
    try:
        with zipfile.ZipFile(source) as archive:
            manifest = _manifest(archive)
            _keep_artifacts(store, archive)
            with database.transaction() as connection:
                why = f"imported from an archive of {manifest['written_at']}"
                connection.execute(
                    text("SELECT set_config('buildarena.why', :why, true)"), {"why": why}
                )
                return _take_in(archive, connection, str(manifest["sweep"]), owner)
    except (zipfile.BadZipFile, KeyError, ValueError, TypeError, NotImplementedError) as error:
        raise ArchiveError(f"this is not a valid archive of a sweep: {error}") from error
    except StatementError as error:
        if isinstance(error, OperationalError):
            raise
        raise ArchiveError("a value in the archive does not fit its column") from error


def _manifest(archive: zipfile.ZipFile) -> Mapping[str, Any]:
    manifest: Mapping[str, Any] = json.loads(_bytes(archive, "manifest.json"))
    if manifest["format"] != FORMAT or manifest["schema"] != expected_schema():
        raise ArchiveError(
            f"the archive has format {manifest['format']} and schema {manifest['schema']}; this "
            f"program reads {FORMAT} and {expected_schema()}: use BuildArena "
            f"{manifest['buildarena']}"
        )
    return manifest


def _bytes(archive: zipfile.ZipFile, name: str) -> bytes:
    """A member's bytes, if they are not too many, whatever its header says."""
    with archive.open(name) as member:
        data = member.read(LARGEST_MEMBER + 1)
    if len(data) > LARGEST_MEMBER:
        raise ArchiveError(f"{name} is larger than {LARGEST_MEMBER:,} bytes")
    return data


def _rows(archive: zipfile.ZipFile, table: Table) -> Iterator[dict[str, Any]]:
    columns = {column.name: column for column in table.c}
    for line in _bytes(archive, f"rows/{table.name}.jsonl").splitlines():
        values = json.loads(line)
        if not isinstance(values, dict) or values.keys() != columns.keys():
            raise ArchiveError(f"{table.name} does not have this program's columns")
        yield {name: _typed(columns[name], value) for name, value in values.items()}


def _typed(column: Column[Any], value: Any) -> Any:
    if isinstance(value, str) and isinstance(column.type, DateTime):
        return datetime.fromisoformat(value)
    if isinstance(value, str) and isinstance(column.type, Numeric):
        return Decimal(value)
    return value


def _keep_artifacts(store: ArtifactStore, archive: zipfile.ZipFile) -> None:
    types = {row["hash"]: row["media_type"] for row in _rows(archive, artifacts)}
    inside = {match[1] for name in archive.namelist() if (match := ARTIFACT_NAME.fullmatch(name))}
    if inside != types.keys():
        raise ArchiveError("its artifacts do not match its rows")
    for digest, media_type in types.items():
        data = _bytes(archive, f"artifacts/{digest}")
        if hashlib.sha256(data).hexdigest() != digest:
            raise ArchiveError(f"artifact {digest} was changed")
        store.put(data, media_type)


def _take_in(
    archive: zipfile.ZipFile, connection: Connection, sweep_id: str, owner: str | None
) -> Imported:
    job_rows = [_arriving(row, sweep_id, owner) for row in _rows(archive, jobs)]
    ids = {row["id"] for row in job_rows}
    _insert(connection, tasks, ({**row, "owner": owner} for row in _rows(archive, tasks)))
    _insert(connection, artifacts, _rows(archive, artifacts))
    added = set(_insert(connection, jobs, job_rows, returning=jobs.c.id))
    for table in OF_JOBS:
        rows = list(_rows(archive, table))
        if not {row["job_id"] for row in rows} <= ids:
            raise ArchiveError(f"{table.name} names jobs that are not in the archive")
        _insert(connection, table, (row for row in rows if row["job_id"] in added))
    (sweep,) = _rows(archive, sweeps)
    open_jobs = any(row["state"] != JobState.DONE for row in job_rows)
    arriving = {
        **sweep,
        "id": sweep_id,
        "owner": owner,
        "request_key": None,
        "state": SweepState.PAUSED if open_jobs else sweep["state"],
    }
    if _insert(connection, sweeps, [arriving], returning=sweeps.c.id):
        _insert(connection, sweep_jobs, [{"sweep_id": sweep_id, "job_id": id_} for id_ in ids])
        events.record_sweep(connection, sweep_id, "imported", {"jobs": len(ids)})
    return Imported(sweep_id=sweep_id, jobs=len(ids), added=len(added))


def _arriving(row: dict[str, Any], sweep_id: str, owner: str | None) -> dict[str, Any]:
    key = JobKey(**{name: row[name] for name in JobKey.__dataclass_fields__})
    if row["id"] != key.job_id:
        raise ArchiveError(f"job {row['id']} does not match its id: it was changed")
    waiting = {
        "state": JobState.ON_HOLD,
        "lease_owner": None,
        "lease_expires_at": None,
        "notified_at": None,
    }
    ended = row["state"] == JobState.DONE
    return {**row, "owner": owner, "payer": sweep_id, **({} if ended else waiting)}


def _insert(
    connection: Connection,
    table: Table,
    rows: Iterable[Mapping[str, Any]],
    *,
    returning: Column[Any] | None = None,
) -> list[Any]:
    """Inserts what is not there; returns the chosen column of what was."""
    inserted: list[Any] = []
    waiting = list(rows)
    for start in range(0, len(waiting), CHUNK):
        statement = insert(table).values(waiting[start : start + CHUNK]).on_conflict_do_nothing()
        if returning is None:
            connection.execute(statement)
        else:
            inserted += connection.execute(statement.returning(returning)).scalars()
    return inserted
