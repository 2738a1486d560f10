"""Recovery of leases that ran out: their jobs wait again or are given up."""

from __future__ import annotations

from typing import Final

from sqlalchemy import Boolean, and_, case, func, literal, literal_column, select, update

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import jobs
from buildarena_backend.database.tables import leases as expiries
from buildarena_backend.jobs.attempts import Ending, end_attempts
from buildarena_backend.leases.runner_backoff import MIN_KEYS, MISSED_BEFORE, RUNNER
from buildarena_backend.states import AttemptResult, JobState, Outcome, Stage

EXPIRES_AT: Final = (
    select(expiries.c.expires_at)
    .where(expiries.c.job_id == jobs.c.id, expiries.c.token == jobs.c.lease_token)
    .scalar_subquery()
)
"""End of a running job's lease; null of a session of an external agent, which has none."""
_LOST = select(jobs.c.id).where(jobs.c.state == JobState.RUNNING, events.now > EXPIRES_AT)
ANY_LOST: Final = _LOST.exists()
# A session has one request open at most, whose reply is lost with its process.
_IN_SESSION = jobs.c.stage == Stage.CONSTRUCT


def recover_lost(database: Database, *, max_faults: int) -> list[str]:
    """Re-queue jobs whose lease ran out, and give up those that keep losing their workers.

    Returns:
        Ids of the jobs that wait again.
    """
    # Nearly always there is none, and the reaper checks often.
    if not database.first_value(select(ANY_LOST)):
        return []
    # A key of runners counts once, and never ends a job alone.
    is_runners = func.starts_with(jobs.c.lease_owner, RUNNER)
    missed_before = and_(is_runners, literal_column(MISSED_BEFORE, Boolean))
    faults = jobs.c.faults + case((missed_before, 0), else_=1)
    limit = case((is_runners, max(max_faults, MIN_KEYS)), else_=max_faults)
    last = faults >= limit
    with database.transaction() as connection:
        lost = _LOST.with_for_update(skip_locked=True).scalar_subquery()
        rows = connection.execute(
            update(jobs)
            .where(jobs.c.id.in_(lost))
            .values(
                state=case((last, literal(JobState.DONE.value)), else_=JobState.QUEUED.value),
                outcome=case((last, literal(Outcome.ERRORED.value)), else_=None),
                reason=case((last, literal("lost_worker")), else_=None),
                detail=case((last, literal("it lost its workers again and again")), else_=None),
                finished_at=case((last, events.now), else_=None),
                faults=faults,
                lost_requests=jobs.c.lost_requests + case((_IN_SESSION, 1), else_=0),
                lease_owner=None,
                available_at=events.now,
            )
            .returning(jobs.c.id, jobs.c.state, jobs.c.lease_token, jobs.c.stage)
        ).all()
        endings = [
            Ending(
                job_id=row.id,
                token=row.lease_token,
                state=JobState(row.state),
                data={"stage": row.stage, "why": "lost worker"},
            )
            for row in rows
        ]
        end_attempts(
            endings, AttemptResult.LOST, "no heartbeat was received", connection=connection
        )
    return [row.id for row in rows if row.state == JobState.QUEUED]
