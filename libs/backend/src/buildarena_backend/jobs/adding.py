"""The statements that add jobs: by the hundred thousand as well as one.

Jobs are written in the order of their ids, which most indexes of `jobs` end in, so that a page is
fetched once for several of them; their times of creation keep the order in which they were given,
which they are claimed in.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from itertools import accumulate
from random import SystemRandom
from typing import Any, Final

from sqlalchemy import ARRAY, BigInteger, Connection, bindparam, func, literal, select
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend import events
from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs
from buildarena_backend.jobs.job import NewJobs
from buildarena_backend.states import CONSTRUCT_QUEUE, JobState, Stage

DRAWS: Final = 2**53
"""Draws are below: JSON holds them as they are."""
_APART: Final = timedelta(microseconds=1)
"""Between the times of creation of jobs that are added together."""


def add_jobs(new: Sequence[NewJobs], *, connection: Connection) -> list[str]:
    """Adds the jobs that do not exist yet.

    Args:
        new: The jobs, the first to be claimed first.
        connection: The transaction it is part of.

    Returns:
        Ids of those that were added.
    """
    places = accumulate((len(some.seeds) for some in new), initial=0)
    placed = list(zip(new, places, strict=False))
    found: list[str] = []
    # In one order, so that no two submissions of the same jobs wait for each other.
    for some, place in sorted(placed, key=lambda pair: pair[0].key(0).job_id):
        found += connection.execute(_insertion(some, place)).scalars()
    events.record_jobs(connection, found, JobState.QUEUED, {"stage": Stage.CONSTRUCT})
    return found


ALIKE: Final = (
    *("task", "task_version", "model", "model_hash", "model_config", "track", "track_config"),
    *("limits", "owner", "payer", "traceparent"),
)
"""What all of these jobs have in common, by the names of columns."""


def _insertion(new: NewJobs, place: int) -> Any:
    draws = SystemRandom()
    single = (
        func.unnest(
            bound_texts(new.job_ids),
            _numbers(new.seeds),
            _numbers([draws.randrange(DRAWS) for _ in new.seeds]),
        )
        .table_valued("id", "seed", "draw", with_ordinality="place", name="single")
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
        *(single.c[name] for name in ("id", "seed", "draw")),
        began + (single.c.place + place) * literal(_APART),
        *(literal(value, jobs.c[name].type) for name, value in alike.items()),
    ).order_by(single.c.id)
    statement = insert(jobs).from_select(["id", "seed", "draw", "created_at", *alike], rows)
    return statement.on_conflict_do_nothing().returning(jobs.c.id)


def _numbers(values: Sequence[int]) -> Any:
    return bindparam(None, list(values), ARRAY(BigInteger))
