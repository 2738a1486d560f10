"""Importing archives: everything that is missing, or nothing."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel
from sqlalchemy import Column, Connection, Table, func, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.exc import OperationalError, StatementError

from buildarena_benchmark.scorers.scorer import REFUTED
from buildarena_store import events
from buildarena_store.accounts.names import NameKind, claim_name
from buildarena_store.archives.members import ArchiveError, Members
from buildarena_store.archives.rows import (
    ArtifactRow,
    AttemptRow,
    ExternalCallRow,
    JobArtifactRow,
    JobRow,
    JournalRow,
    ManifestFile,
    RolloutRow,
    SweepRow,
    TaskRow,
)
from buildarena_store.archives.writing import CHUNK, FORMAT
from buildarena_store.artifacts import ArtifactStore
from buildarena_store.database import SCHEMA, Database
from buildarena_store.errors import NameTakenError
from buildarena_store.ids import content_hash
from buildarena_store.jobs.audits import require_audits
from buildarena_store.states import (
    EXTERNAL_PROVIDER,
    EXTERNAL_QUEUE,
    Audit,
    JobState,
    Outcome,
    SweepState,
)
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

COUNTED: Final = (
    "requests",
    "input_tokens",
    "output_tokens",
    "cached_tokens",
    "reasoning_tokens",
    "cost_usd",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """The result of an import.

    Attributes:
        sweep_id: The sweep.
        jobs: Jobs it consists of.
        added: Jobs that were not there before.
        unverified: Scores among them that count when they were found again here.
    """

    sweep_id: str
    jobs: int
    added: int
    unverified: int


def read_archive(
    database: Database,
    store: ArtifactStore,
    source: Path,
    *,
    check_spec: Callable[[Mapping[str, Any]], object],
    owner: str | None = None,
) -> Imported:
    """Imports a sweep: everything that is missing, or nothing.

    Jobs that had not ended come in on hold, and the sweep as paused: resuming it goes on from
    their journals. Scores wait for their verification, which is requested.

    Args:
        database: Where its rows go.
        store: Where its artifacts go.
        source: The archive.
        check_spec: Raises a ValueError for a sweep's matrix that could not be submitted.
        owner: Id of the API key that it belongs to from now on.

    Raises:
        ArchiveError: It is damaged, was changed, or comes from another version.
        ArtifactStoreError: Its artifacts can't be stored now.
    """
    with closing(Members(source)) as members:
        manifest = _manifest(members)
        archive = _Archive(members, manifest, owner)
        archive.check(check_spec)
        archive.keep_artifacts(store)
        try:
            with database.transaction() as connection:
                events.say_why(f"imported from {archive.origin}", connection)
                return archive.take_in(connection)
        except StatementError as error:
            if isinstance(error, OperationalError):
                raise
            raise ArchiveError("a value in the archive does not fit its column") from error


def _manifest(members: Members) -> ManifestFile:
    manifest = members.manifest(ManifestFile)
    if manifest.format != FORMAT or manifest.schema_version != SCHEMA:
        raise ArchiveError(
            f"the archive has format {manifest.format} and schema {manifest.schema_version}; this "
            f"program reads {FORMAT} and {SCHEMA}: use BuildArena {manifest.buildarena}"
        )
    return manifest


@dataclass(slots=True)
class _Sums:
    """What the rows of one job add up to."""

    entries: int = 0
    calls: int = 0
    rollouts: int = 0
    used: dict[str, Decimal] = field(default_factory=lambda: defaultdict(Decimal))


class _Archive:
    """An archive on its way in."""

    def __init__(self, members: Members, manifest: ManifestFile, owner: str | None) -> None:
        self._members = members
        self._owner = owner
        self._sweep_id = manifest.sweep
        self._jobs: dict[str, JobRow] = {}
        self._hashes: dict[str, ArtifactRow] = {}
        self.origin = f"an archive of {manifest.sweep}, written {manifest.written_at.isoformat()}"

    def check(self, check_spec: Callable[[Mapping[str, Any]], object]) -> None:
        """Reads every row once, before anything is stored.

        Raises:
            ArchiveError: A row is wrong, by itself or beside the others.
        """
        sweep = self._sweep()
        try:
            check_spec(sweep.spec)
        except ValueError as error:
            raise ArchiveError(f"the sweep's spec: {error}") from error
        self._hashes = {row.hash: row for row in self._members.rows("artifacts", ArtifactRow)}
        if self._members.artifacts != self._hashes.keys():
            raise ArchiveError("its artifacts do not match its rows")
        for row in self._members.rows("jobs", JobRow):
            if row.id in self._jobs:
                raise ArchiveError(f"job {row.id} is in it twice")
            self._jobs[row.id] = row
        _read_through(self._members.rows("tasks", TaskRow))
        self._check_rows_of_jobs()

    def _check_rows_of_jobs(self) -> None:
        sums: dict[str, _Sums] = defaultdict(_Sums)
        _read_through(self._of_jobs("attempts", AttemptRow))
        for entry in self._of_jobs("journal", JournalRow):
            mine = sums[entry.job_id]
            _require_next("journal", entry.job_id, entry.sequence, mine.entries)
            mine.entries += 1
            mine.used["requests"] += 1
            for name in COUNTED[1:]:
                mine.used[name] += getattr(entry, name)
        for call in self._of_jobs("external_calls", ExternalCallRow):
            _require_next("external_calls", call.job_id, call.sequence, sums[call.job_id].calls)
            sums[call.job_id].calls += 1
        for rollout in self._of_jobs("rollouts", RolloutRow):
            mine = sums[rollout.job_id]
            _require_next("rollouts", rollout.job_id, rollout.number, mine.rollouts)
            mine.rollouts += 1
            self._require_stored(rollout.machine_hash, rollout.trajectory_hash)
        for made in self._of_jobs("job_artifacts", JobArtifactRow):
            self._require_stored(made.hash)
        for id_, job in self._jobs.items():
            used = sums[id_].used
            wrong = [name for name in COUNTED if getattr(job, name) != used[name]]
            if wrong:
                raise ArchiveError(f"job {id_}: {wrong[0]} is not what its journal adds up to")

    def keep_artifacts(self, store: ArtifactStore) -> None:
        """Stores the artifacts, whose bytes must be what their names say."""
        for digest, row in self._hashes.items():
            data = self._members.artifact(digest)
            if len(data) != row.size:
                raise ArchiveError(f"artifact {digest} has {len(data):,} bytes, not {row.size:,}")
            store.put(data, row.media_type)

    def take_in(self, connection: Connection) -> Imported:
        """Stores the rows that are missing."""
        self._require_same_jobs(connection)
        self._take_in_names(connection)
        self._take_in_tasks(connection)
        known = ({**row.model_dump()} for row in self._hashes.values())
        _insert(connection, artifacts, known)
        arriving = [self._arriving(row) for row in self._jobs.values()]
        added = set(_insert(connection, jobs, arriving, returning=jobs.c.id))
        of_jobs: tuple[tuple[Table, type[BaseModel]], ...] = (
            (attempts, AttemptRow),
            (journal, JournalRow),
            (external_calls, ExternalCallRow),
            (rollouts, RolloutRow),
            (job_artifacts, JobArtifactRow),
        )
        for table, kind in of_jobs:
            rows = (row.model_dump() for row in self._of_jobs(table.name, kind))
            _insert(connection, table, (row for row in rows if row["job_id"] in added))
        self._take_in_sweep(connection)
        scored = [id_ for id_ in sorted(added) if self._jobs[id_].success is not None]
        require_audits(scored, connection=connection)
        return Imported(
            sweep_id=self._sweep_id,
            jobs=len(self._jobs),
            added=len(added),
            unverified=len(scored),
        )

    def _require_same_jobs(self, connection: Connection) -> None:
        """A sweep that is here keeps its jobs."""
        here = select(sweeps.c.id).where(sweeps.c.id == self._sweep_id)
        if connection.execute(here).first() is None:
            return
        members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == self._sweep_id)
        if set(connection.execute(members).scalars()) != self._jobs.keys():
            raise ArchiveError(f"{self._sweep_id} is here, with other jobs than in the archive")

    def _take_in_names(self, connection: Connection) -> None:
        """Names that nobody here has played under are the importer's from now on."""
        players = {
            (str(row.model_config_.get("model")), row.model.startswith("human/"))
            for row in self._jobs.values()
            if row.model_config_.get("provider") == EXTERNAL_PROVIDER
        }
        for name, person in sorted(players):
            # One that is of the other kind here stays so: results keep the names they came with.
            with suppress(NameTakenError):
                kind: NameKind = "human" if person else "agent"
                claim_name(kind, name, owner=self._owner, connection=connection, force=True)

    def _take_in_tasks(self, connection: Connection) -> None:
        """Versions that are missing; where a name is known here, they come behind ours.

        So nobody gets another version for a new submission than before.
        """
        for row in self._members.rows("tasks", TaskRow):
            claim_name("task", row.name, owner=self._owner, connection=connection, force=True)
            oldest = select(func.min(tasks.c.created_at)).where(tasks.c.name == row.name)
            first = connection.execute(oldest).scalar()
            created_at = row.created_at if first is None else min(first, row.created_at)
            values = {**row.model_dump(), "owner": self._owner, "created_at": created_at}
            _insert(connection, tasks, [values])

    def _arriving(self, row: JobRow) -> dict[str, Any]:
        """A job as it is stored here."""
        ours: dict[str, Any] = {
            "owner": self._owner,
            "payer": self._sweep_id,
            "lease_owner": None,
            "lease_expires_at": None,
            "notified_at": None,
            "imported_from": self.origin,
            "audit": None if row.success is None else Audit.REQUIRED,
            "verified_at": None,
            "flags": None
            if row.flags is None
            else [flag for flag in row.flags if flag != REFUTED.name],
        }
        if row.state != JobState.DONE and row.queue == EXTERNAL_QUEUE:
            # Its agent is not here.
            ours |= {"state": JobState.DONE, "outcome": Outcome.CANCELLED, "reason": "abandoned"}
            ours["finished_at"] = events.now
        elif row.state != JobState.DONE:
            ours |= {"state": JobState.ON_HOLD, "available_at": events.now}
        values = row.values() | ours
        if values["available_at"] is None:
            values["available_at"] = events.now
        return values

    def _take_in_sweep(self, connection: Connection) -> None:
        sweep, ids = self._sweep(), sorted(self._jobs)
        open_jobs = any(row.state != JobState.DONE for row in self._jobs.values())
        arriving = {
            **sweep.model_dump(),
            "owner": self._owner,
            "request_key": None,
            "jobs_hash": content_hash(ids),
            "state": SweepState.PAUSED if open_jobs else sweep.state,
        }
        if _insert(connection, sweeps, [arriving], returning=sweeps.c.id):
            members = [{"sweep_id": self._sweep_id, "job_id": id_} for id_ in ids]
            _insert(connection, sweep_jobs, members)
            events.record_sweep(connection, self._sweep_id, "imported", {"jobs": len(ids)})

    def _sweep(self) -> SweepRow:
        rows = list(self._members.rows("sweeps", SweepRow))
        if len(rows) != 1 or rows[0].id != self._sweep_id:
            raise ArchiveError(f"it must hold one sweep, {self._sweep_id}")
        return rows[0]

    def _of_jobs(self, name: str, kind: type[Any]) -> Iterator[Any]:
        for row in self._members.rows(name, kind):
            if row.job_id not in self._jobs:
                raise ArchiveError(f"{name} names job {row.job_id}, which is not in the archive")
            yield row

    def _require_stored(self, *digests: str | None) -> None:
        for digest in digests:
            if digest is not None and digest not in self._hashes:
                raise ArchiveError(f"artifact {digest} is not in the archive")


def _read_through(rows: Iterator[object]) -> None:
    """Reads rows that have nothing to be compared with: each is checked as it is read."""
    deque(rows, maxlen=0)


def _require_next(table: str, job_id: str, given: int, wanted: int) -> None:
    """Rows of a job come in their order, without a gap."""
    if given != wanted:
        raise ArchiveError(f"{table} of {job_id} goes on with {given} where {wanted} is next")


def _insert(
    connection: Connection,
    table: Table,
    rows: Iterable[Mapping[str, Any]],
    *,
    returning: Column[Any] | None = None,
) -> list[Any]:
    """Inserts what is not there; returns the chosen column of what was."""
    inserted: list[Any] = []
    waiting: list[Mapping[str, Any]] = []

    def flush() -> None:
        statement = insert(table).values(waiting).on_conflict_do_nothing()
        if returning is None:
            connection.execute(statement)
        else:
            inserted.extend(connection.execute(statement.returning(returning)).scalars())
        waiting.clear()

    for row in rows:
        waiting.append(row)
        if len(waiting) == CHUNK:
            flush()
    if waiting:
        flush()
    return inserted
