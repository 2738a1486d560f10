"""Job claims of sweeps and keys, and the choice of a job's next payer.

A job has one payer at a time: an active sweep, or, with no payer, the key that asked for just this
job. A payer that stops hands the job over to another claimant; a paused sweep, or one whose
budget is used up, wants its jobs too, but lets them wait.
"""

from __future__ import annotations

from typing import Any, Final

from sqlalchemy import (
    ColumnElement,
    Connection,
    DateTime,
    Select,
    Subquery,
    Text,
    cast,
    delete,
    exists,
    func,
    null,
    select,
    true,
    union_all,
    update,
)
from sqlalchemy.dialects.postgresql import distinct_on, insert

from buildarena_backend.database.tables import job_claims, jobs, sweep_jobs, sweeps
from buildarena_backend.leases.claiming import OPERATOR
from buildarena_backend.states import JobState, Outcome, SweepState

UNSCORED: Final = (jobs.c.state != JobState.DONE) | (jobs.c.outcome == Outcome.ERRORED)
"""Jobs that may still cost something: those that go on, and those that can be retried."""


def add_claim(job_id: str, owner: str | None, *, connection: Connection) -> None:
    """Note that a key wants a job by itself, in addition to sweeps."""
    row = insert(job_claims).values(job_id=job_id, owner=owner or OPERATOR)
    connection.execute(row.on_conflict_do_nothing())


def has_claim(job_id: str, owner: str | None, *, connection: Connection) -> bool:
    """Return whether a key wants a job, by itself or in one of its sweeps."""
    claims = _claims()
    own = claims.c.owner.is_not_distinct_from(owner)
    return bool(connection.execute(select(exists().where(claims.c.job_id == job_id, own))).scalar())


def withdraw(job_id: str, owner: str | None, *, connection: Connection) -> None:
    """Take back every claim that a key has in a job, its sweeps' included."""
    singly = delete(job_claims).where(
        job_claims.c.job_id == job_id, job_claims.c.owner == (owner or OPERATOR)
    )
    own = select(sweeps.c.id).where(sweeps.c.owner.is_not_distinct_from(owner))
    by_sweeps = (
        update(sweep_jobs)
        .where(sweep_jobs.c.job_id == job_id, sweep_jobs.c.claimed, sweep_jobs.c.sweep_id.in_(own))
        .values(claimed=False)
    )
    connection.execute(singly)
    connection.execute(by_sweeps)


def members(sweep_id: str) -> Select[Any]:
    """Return a query for the ids of the jobs that a sweep wants."""
    return select(sweep_jobs.c.job_id).where(
        sweep_jobs.c.sweep_id == sweep_id, sweep_jobs.c.claimed
    )


def claimed_by_others(owner: str | None) -> ColumnElement[bool]:
    """Return the condition that another owner wants a job."""
    claims = _claims()
    return exists().where(claims.c.job_id == jobs.c.id, claims.c.owner.is_distinct_from(owner))


def transfer(
    *which: ColumnElement[bool],
    connection: Connection,
    to_waiting: bool = False,
    except_owner: str | None = None,
) -> list[str]:
    """Make another claimant of each job its payer and owner, if it has one.

    Active sweeps and keys come first, then those of the same owner, then the oldest.

    Args:
        which: Conditions on the jobs; those with a score stay as they are.
        connection: A transaction of `SweepLifecycle.command`.
        to_waiting: Whether paused and stopped sweeps get jobs as well.
        except_owner: A key that gets none, as its budget is used up.

    Returns:
        Ids of the jobs that went to sweeps that let them wait.
    """
    claims = _claims()
    another = claims.c.payer.is_distinct_from(jobs.c.payer) | claims.c.owner.is_distinct_from(
        jobs.c.owner
    )
    takers = (
        select(claims.c.job_id, claims.c.payer, claims.c.owner, claims.c.active)
        .join(jobs, jobs.c.id == claims.c.job_id)
        .where(*which, UNSCORED, another)
        .ext(distinct_on(claims.c.job_id))
        .order_by(
            claims.c.job_id,
            claims.c.active.desc(),
            claims.c.owner.is_not_distinct_from(jobs.c.owner).desc(),
            claims.c.since.asc().nulls_first(),
            claims.c.payer,
        )
    )
    if not to_waiting:
        takers = takers.where(claims.c.active)
    if except_owner is not None:
        takers = takers.where(claims.c.owner.is_distinct_from(except_owner))
    taker = takers.subquery("taker")
    rows = connection.execute(
        update(jobs)
        .where(jobs.c.id == taker.c.job_id)
        .values(payer=taker.c.payer, owner=taker.c.owner)
        .returning(jobs.c.id, taker.c.active)
    )
    return [row.id for row in rows if not row.active]


def _claims() -> Subquery:
    """Return all claims on jobs: payer, owner, whether the job would continue, and time."""
    by_sweeps = (
        select(
            sweep_jobs.c.job_id,
            sweeps.c.id.label("payer"),
            sweeps.c.owner,
            (sweeps.c.state == SweepState.ACTIVE).label("active"),
            sweeps.c.created_at.label("since"),
        )
        .join(sweeps, sweeps.c.id == sweep_jobs.c.sweep_id)
        .where(sweep_jobs.c.claimed, sweeps.c.state != SweepState.CANCELLED)
    )
    singly = select(
        job_claims.c.job_id,
        cast(null(), Text),
        func.nullif(job_claims.c.owner, OPERATOR),
        true(),
        cast(null(), DateTime(timezone=True)),
    )
    return union_all(by_sweeps, singly).subquery("claims")
