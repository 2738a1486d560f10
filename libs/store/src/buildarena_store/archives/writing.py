"""Writing archives."""

from __future__ import annotations

import json
import zipfile
from datetime import UTC, datetime
from decimal import Decimal
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, Table, func, select, text

from buildarena_store.artifacts import ArtifactStore
from buildarena_store.database import SCHEMA, Database
from buildarena_store.jobs.histories import Histories
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
NOT_OF_JOBS: Final = (jobs.c.traceparent,)
"""Columns that mean nothing to another service."""
CHUNK: Final = 500


def write_archive(database: Database, store: ArtifactStore, sweep_id: str, target: Path) -> None:
    """Writes a sweep with everything that belongs to it, as of one moment.

    Raises:
        UnknownIdError: There is no such sweep.
        ArtifactMissingError: The artifact store has lost something of it.
    """
    Sweeps(database).get(sweep_id)
    members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
    with database.transaction() as connection:
        job_ids = list(connection.execute(members).scalars())
    Histories(database, store).unpack(job_ids)
    with (
        database.transaction() as connection,
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
        _write_rows(archive, connection, sweep_id)
        hashes = select(job_artifacts.c.hash).where(job_artifacts.c.job_id.in_(members)).distinct()
        for digest in connection.execute(hashes.order_by(job_artifacts.c.hash)).scalars():
            archive.writestr(f"artifacts/{digest}", store.get(digest))
        manifest = {
            "format": FORMAT,
            "schema": SCHEMA,
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
        columns = [column for column in table.c if column not in NOT_OF_JOBS]
        query = select(*columns).where(condition).order_by(*table.primary_key.columns)
        with archive.open(f"rows/{table.name}.jsonl", "w") as member:
            for row in connection.execution_options(yield_per=CHUNK).execute(query):
                values = {column.name: _plain(getattr(row, column.name)) for column in columns}
                member.write(json.dumps(values, ensure_ascii=False).encode() + b"\n")


def _plain(value: Any) -> Any:
    if isinstance(value, datetime):
        return value.isoformat()
    return str(value) if isinstance(value, Decimal) else value
