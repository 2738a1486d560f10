"""The statement that adds jobs: by the hundred thousand as well as one.

Jobs of a sweep differ in little: what many of them share is sent once. They are written in the
order of their ids, which most indexes of `jobs` end in, so that a page is fetched once for several
of them; their times of creation keep the order in which they were given, which they are claimed in.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from random import SystemRandom
from typing import Any, Final

from sqlalchemy import ARRAY, BigInteger, Connection, bindparam, column, func, literal, select
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend import events
from buildarena_backend.database.rows import bound_texts, rows_of
from buildarena_backend.database.tables import jobs
from buildarena_backend.jobs.job import NewJob
from buildarena_backend.states import CONSTRUCT_QUEUE, JobState, Stage

DRAWS: Final = 2**53
"""Draws are below: JSON holds them as they are."""
_APART: Final = timedelta(microseconds=1)
"""Between the times of creation of jobs that are added together."""
_KIND: Final = column("kind", BigInteger)


def add_jobs(new: Sequence[NewJob], *, connection: Connection) -> list[str]:
    """Adds the jobs that do not exist yet.

    Args:
        new: The jobs, the first to be claimed first.
        connection: The transaction it is part of.

    Returns:
        Ids of those that were added.
    """
    kinds: dict[tuple[Any, ...], int] = {}
    kind_of = [kinds.setdefault(_kind(job), len(kinds)) for job in new]
    first = dict(zip(reversed(kind_of), reversed(new), strict=True))
    alike = [{"kind": kind, **_alike(job)} for kind, job in first.items()]
    names = [name for name in alike[0] if name != "kind"]
    # One JSON text and four arrays, and not a bound value for each column of each row.
    kind = rows_of(alike, [_KIND, *(jobs.c[name] for name in names)])
    draws = SystemRandom()
    single = (
        func.unnest(
            bound_texts([job.key.job_id for job in new]),
            _numbers([job.key.seed for job in new]),
            _numbers([draws.randrange(DRAWS) for _ in new]),
            _numbers(kind_of),
        )
        .table_valued("id", "seed", "draw", "kind", with_ordinality="place", name="single")
        .render_derived()
    )
    together = select(func.clock_timestamp()).scalar_subquery()
    rows = (
        select(
            *(single.c[name] for name in ("id", "seed", "draw")),
            together + single.c.place * literal(_APART),
            *(kind.c[name] for name in names),
        )
        .join_from(single, kind, single.c.kind == kind.c.kind)
        .order_by(single.c.id)
    )
    statement = insert(jobs).from_select(["id", "seed", "draw", "created_at", *names], rows)
    added = connection.execute(statement.on_conflict_do_nothing().returning(jobs.c.id))
    found = list(added.scalars())
    events.record_jobs(connection, found, JobState.QUEUED, {"stage": Stage.CONSTRUCT})
    return found


def _numbers(values: Sequence[int]) -> Any:
    return bindparam(None, values, ARRAY(BigInteger))


def _kind(job: NewJob) -> tuple[Any, ...]:
    """Equal for jobs that differ in nothing but seeds and draws."""
    key, payer = job.key, (job.owner, job.payer, job.traceparent)
    objects = map(id, (job.model_config, job.track_config, job.limits))
    return (key.task, key.task_version, key.model_hash, key.track, job.model, *payer, *objects)


def _alike(job: NewJob) -> dict[str, Any]:
    key = job.key
    return {
        "task": key.task,
        "task_version": key.task_version,
        "model": job.model,
        "model_hash": key.model_hash,
        "model_config": dict(job.model_config),
        "track": key.track,
        "track_config": dict(job.track_config),
        "limits": dict(job.limits),
        "owner": job.owner,
        "payer": job.payer,
        "traceparent": job.traceparent,
        "stage": Stage.CONSTRUCT,
        "queue": CONSTRUCT_QUEUE,
        "state": JobState.QUEUED,
    }
