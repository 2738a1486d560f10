"""Jobs in the database: added once for each key, found, cancelled and retried."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from itertools import accumulate
from random import SystemRandom
from typing import Any, Final

from sqlalchemy import (
    ARRAY,
    BigInteger,
    ColumnElement,
    Connection,
    any_,
    bindparam,
    exists,
    func,
    literal,
    select,
    text,
    update,
)
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import bound_texts, known, value_of
from buildarena_backend.database.tables import artifacts, attempts, job_artifacts, jobs
from buildarena_backend.jobs.attempts import Attempt, Ending, end_attempts
from buildarena_backend.jobs.filters import JobFilter, distinct_values
from buildarena_backend.jobs.job import JOB_COLUMNS, Artifact, Job, NewJobs
from buildarena_backend.jobs.pages import Order, SortValue, read_page
from buildarena_backend.jobs.summaries import JobSummary, summarise
from buildarena_backend.jobs.transitions import REOPENED, transition
from buildarena_backend.states import CONSTRUCT_QUEUE, AttemptResult, JobState, Outcome, Stage

RANDOMIZATION_SEEDS: Final = 2**53
"""Randomization seeds are below: JSON holds them as they are."""
_APART: Final = timedelta(microseconds=1)
"""Between the times of creation of jobs that are added together."""


def add_jobs(new: Sequence[NewJobs], *, connection: Connection) -> list[str]:
    """Add the jobs that do not exist yet.

    Args:
        new: The jobs, the first to be claimed first.
        connection: The transaction it is part of.

    Returns:
        Ids of those that were added.
    """
    places = accumulate((len(some.seeds) for some in new), initial=0)
    placed = list(zip(new, places, strict=False))
    added: list[str] = []
    # In one order, so that no two submissions of the same jobs wait for each other.
    for some, place in sorted(placed, key=lambda pair: pair[0].job_ids[0]):
        added += connection.execute(_insertion(some, place)).scalars()
    events.record_jobs(connection, added, JobState.QUEUED, {"stage": Stage.CONSTRUCT})
    return added


ALIKE: Final = (
    *("task", "task_version", "model", "model_hash", "model_config", "track", "track_config"),
    *("limits", "owner", "payer", "traceparent"),
)
"""Values shared by all of these jobs, by column name."""


def _insertion(new: NewJobs, place: int) -> Any:
    random = SystemRandom()
    single = (
        func.unnest(
            bound_texts(new.job_ids),
            _numbers(new.seeds),
            _numbers([random.randrange(RANDOMIZATION_SEEDS) for _ in new.seeds]),
        )
        .table_valued("id", "seed", "randomization_seed", with_ordinality="place", name="single")
        .render_derived()
    )
    alike = {
        **{name: getattr(new, name) for name in ALIKE},
        "stage": Stage.CONSTRUCT,
        "queue": CONSTRUCT_QUEUE,
        "state": JobState.QUEUED,
    }
    began = select(func.now()).scalar_subquery()
    rows = select(
        *(single.c[name] for name in ("id", "seed", "randomization_seed")),
        began + (single.c.place + place) * literal(_APART),
        *(literal(value, jobs.c[name].type) for name, value in alike.items()),
    ).order_by(single.c.id)
    statement = insert(jobs).from_select(
        ["id", "seed", "randomization_seed", "created_at", *alike], rows
    )
    return statement.on_conflict_do_nothing().returning(jobs.c.id)


def _numbers(values: Sequence[int]) -> Any:
    return bindparam(None, list(values), ARRAY(BigInteger))


class Jobs:
    """Adds, finds, cancels and retries jobs."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, new: Sequence[NewJobs], *, connection: Connection) -> int:
        """Add the jobs that do not exist yet; the others stay as they are.

        A job that was cancelled or put on hold before is opened again, and its new claimant pays
        for the rest of it.

        Returns:
            How many were added or opened again.
        """
        ids = add_jobs(new, connection=connection)
        all_ids = [id_ for some in new for id_ in some.job_ids]
        if len(ids) < len(all_ids):
            ids += self._reopen(all_ids, new[0], connection)
        return len(ids)

    def _reopen(self, ids: Sequence[str], sample: NewJobs, connection: Connection) -> list[str]:
        return transition(
            jobs.c.id == any_(bound_texts(ids)),
            (jobs.c.outcome == Outcome.CANCELLED) | (jobs.c.state == JobState.ON_HOLD),
            to=JobState.QUEUED,
            allowed_from={JobState.DONE, JobState.ON_HOLD},
            data={"why": "wanted again"},
            connection=connection,
            owner=sample.owner,
            payer=sample.payer,
            traceparent=sample.traceparent,
            **REOPENED,
        )

    def get(self, job_id: str) -> Job:
        """Return the job with this id.

        Raises:
            UnknownIdError: The job does not exist.
        """
        row = self._database.first_row(select(*JOB_COLUMNS).where(jobs.c.id == job_id))
        return value_of(Job, known(row, "job", job_id))

    def page(
        self,
        *,
        limit: int,
        after: tuple[SortValue, str] | None = None,
        order: Order | None = None,
        job_filter: JobFilter | None = None,
        sweep_id: str | None = None,
        **equals: str | int | None,
    ) -> list[Job]:
        """Return a page of jobs, the newest first by default, with keyset paging.

        Args:
            after: Sort key and id of the last row of the previous page.
            sweep_id: Only this sweep's jobs, in place of ``job_filter``.
            equals: Column values to match, in place of ``job_filter``; None means any.
        """
        chosen = job_filter or JobFilter(sweep_ids=[sweep_id] if sweep_id else None, equals=equals)
        with self._database.transaction() as connection:
            # One plan for all values would be a bad one for the rare ones.
            connection.execute(text("SET LOCAL plan_cache_mode = force_custom_plan"))
            rows = read_page(connection, chosen, order or Order(), after, limit)
            return [value_of(Job, row) for row in rows]

    def summary(self, job_filter: JobFilter) -> JobSummary:
        """Return the number of jobs by outcome, by reason and by flag."""
        with self._database.transaction() as connection:
            connection.execute(text("SET LOCAL plan_cache_mode = force_custom_plan"))
            return summarise(connection, job_filter)

    def attempts(self, job_id: str) -> list[Attempt]:
        """Return every attempt at the job, oldest first."""
        query = (
            select(attempts, attempts.c.ended_at.label("finished_at"))
            .where(attempts.c.job_id == job_id)
            .order_by(attempts.c.token)
        )
        return [value_of(Attempt, row) for row in self._database.all_rows(query)]

    def distinct(self, column: str) -> list[str]:
        """Return the values that jobs have in a column, in their order.

        Args:
            column: ``task``, ``model``, ``track`` or ``reason``.
        """
        return list(self._database.all_values(distinct_values(jobs.c[column])))

    def used_flags(self, flags: Sequence[str]) -> list[str]:
        """Return those of some flags that a job has, in their order."""
        return [
            flag
            for flag in sorted(set(flags))
            if self._database.first_value(select(exists().where(jobs.c.flags.contains([flag]))))
        ]

    def files(self, job_id: str) -> list[Artifact]:
        """Return the job's artifacts, with metadata of their bytes, by name."""
        query = (
            select(
                job_artifacts.c.name,
                artifacts.c.media_type,
                artifacts.c.size,
                artifacts.c.hash.label("sha256"),
            )
            .join(artifacts, artifacts.c.hash == job_artifacts.c.hash)
            .where(job_artifacts.c.job_id == job_id)
            .order_by(job_artifacts.c.name)
        )
        return [value_of(Artifact, row) for row in self._database.all_rows(query)]

    def artifacts(self, job_id: str) -> dict[str, str]:
        """Return the hashes of the job's artifacts by name, for example ``machine``."""
        query = select(job_artifacts.c.name, job_artifacts.c.hash).where(
            job_artifacts.c.job_id == job_id
        )
        return {row.name: row.hash for row in self._database.all_rows(query)}

    def cancel(self, ids: Sequence[str], *, connection: Connection) -> list[str]:
        """End jobs that have not ended; holders of their leases can no longer write.

        Returns:
            The ids that were cancelled by this call.
        """
        return self._revoke(
            ids,
            JobState.DONE,
            connection=connection,
            outcome=Outcome.CANCELLED,
            finished_at=events.now,
        )

    def hold(self, ids: Sequence[str], *, connection: Connection) -> list[str]:
        """Put jobs that have not ended on hold, including running ones.

        Returns:
            The ids that were put on hold by this call.
        """
        return self._revoke(ids, JobState.ON_HOLD, connection=connection)

    def _revoke(
        self, ids: Sequence[str], to: JobState, *, connection: Connection, **values: Any
    ) -> list[str]:
        """Move jobs that have not ended, and end their leases, if any."""
        rows = connection.execute(
            update(jobs)
            .where(jobs.c.id == any_(bound_texts(ids)), jobs.c.state.not_in([JobState.DONE, to]))
            .values(
                state=to,
                lease_owner=None,
                lease_token=jobs.c.lease_token + 1,
                **values,
            )
            .returning(jobs.c.id, jobs.c.lease_token, jobs.c.outcome)
        )
        endings = [
            Ending(
                job_id=row.id,
                token=row.lease_token - 1,
                state=to,
                data={} if row.outcome is None else {"outcome": row.outcome},
            )
            for row in rows
        ]
        end_attempts(endings, AttemptResult.CANCELLED, None, connection=connection)
        return [ending.job_id for ending in endings]

    def retry(
        self, *which: ColumnElement[bool], connection: Connection, **values: Any
    ) -> list[str]:
        """Queue errored jobs again at the stage where they failed; never re-rolls a score.

        Args:
            which: Conditions on the jobs.
            connection: The transaction it is part of.
            values: Further columns to set.

        Returns:
            The ids that were queued: those that had errored.
        """
        return transition(
            *which,
            jobs.c.outcome == Outcome.ERRORED,
            to=JobState.QUEUED,
            allowed_from={JobState.DONE},
            data={"why": "retry"},
            connection=connection,
            **REOPENED,
            **values,
        )
