"""Audits: scores that count once they were verified, and no longer once they were refuted.

Results from another service's archive, and trials simulated by runners, are only claims. They wait
for a verification, which a worker next to the database does. The last conclusive verification
decides: a refuted score counts nowhere until another one verifies it. A key whose runner submitted
a trial that was refuted is suspended, and everything its runners ever submitted is verified; also
after an inconclusive verification, as a runner may name any version as its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from sqlalchemy import (
    ColumnElement,
    Connection,
    and_,
    any_,
    case,
    cast,
    exists,
    func,
    literal,
    null,
    select,
    text,
    true,
    update,
)
from sqlalchemy.dialects.postgresql import JSONB, insert

from buildarena_backend import events
from buildarena_backend.database.account_tables import api_keys
from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs, rollouts, verifications
from buildarena_backend.ids import new_id
from buildarena_backend.jobs.transitions import REOPENED, transition
from buildarena_backend.leases.runner_backoff import RUNNER
from buildarena_backend.states import (
    Audit,
    JobState,
    Stage,
    Verdict,
    VerificationState,
    simulate_queue,
)
from buildarena_benchmark.scoring.flags import REFUTED

_SCORE: Final = ("success", "indicator", "metrics", "flags")
_OF_JOB: Final = (*_SCORE, "manifest", "audit", "verified_at")
_OF_TRIAL: Final = (
    *(*_SCORE, "trajectory_hash", "trace", "versions", "annotations"),
    *("wall_s", "runner", "finished_at"),
)
"""Columns with the result of a job, and of a trial."""
AUDITOR: Final = "audit"
"""Owner of the verifications that no caller requested; no key has such an id."""


def runner_key(owner: str) -> str | None:
    """Return the key of the runner that has a lease; None for a worker next to the database.

    Args:
        owner: The lease's owner.
    """
    return owner.removeprefix(RUNNER).split("/")[0] if owner.startswith(RUNNER) else None


def origin_of(job_id: str) -> dict[str, Any]:
    """Return columns of an ending job: whether a runner ran it, and whether to verify it."""
    trials = exists().where(rollouts.c.job_id == job_id)
    return {
        "ran_on_runner": trials.where(rollouts.c.runner.is_not(None)),
        "audit": case((trials.where(rollouts.c.audited), Audit.REQUIRED.value), else_=None),
    }


def require_audits(job_ids: Sequence[str], *, connection: Connection) -> None:
    """Request the verification of jobs that count once they were verified; skip others."""
    waiting = select(
        func.unnest(bound_texts([new_id("check") for _ in job_ids])),
        func.unnest(bound_texts(job_ids)).label("job_id"),
    ).subquery()
    asked = (
        select(*waiting.c, literal(VerificationState.QUEUED.value), literal(AUDITOR))
        .join(jobs, jobs.c.id == waiting.c.job_id)
        .where(jobs.c.audit == Audit.REQUIRED)
    )
    columns = ["id", "job_id", "state", "owner"]
    statement = insert(verifications).from_select(columns, asked).on_conflict_do_nothing()
    connection.execute(statement)


def note_verdict(
    job_id: str,
    verdict: Verdict,
    verification_id: str,
    refuted_trials: Sequence[int],
    *,
    connection: Connection,
) -> None:
    """Make a job count, or no longer count, by the verdict of its verification.

    Args:
        verdict: After an inconclusive one, all trials of the same runners are audited.
        verification_id: The verification, for the history.
        refuted_trials: Numbers of the rollouts whose trajectories are not what they must be.
        connection: The transaction that ends the verification.
    """
    if verdict == Verdict.INCONCLUSIVE:
        _audit_all(_runners(job_id, true(), connection), connection)
        return
    flags = func.coalesce(func.nullif(jobs.c.flags, text("'null'::jsonb")), text("'[]'::jsonb"))
    other_flags = flags.op("-")(REFUTED.name)
    scored = and_(jobs.c.id == job_id, jobs.c.state == JobState.DONE)
    if verdict == Verdict.VERIFIED:
        # What needs no verification needs no mark that it had one.
        connection.execute(
            update(jobs)
            .where(scored, jobs.c.audit.in_([Audit.REQUIRED, Audit.REFUTED]))
            .values(audit=Audit.VERIFIED, verified_at=events.now, flags=other_flags)
        )
        return
    refuted = connection.execute(
        update(jobs)
        .where(scored, jobs.c.audit.is_distinct_from(Audit.REFUTED.value))
        .values(
            audit=Audit.REFUTED,
            verified_at=None,
            flags=other_flags.op("||")(cast([REFUTED.name], JSONB)),
        )
        .returning(jobs.c.id)
    ).all()
    if refuted:
        events.record_jobs(connection, [job_id], REFUTED.name, {"verification": verification_id})
        keys = _runners(job_id, rollouts.c.number.in_(refuted_trials), connection)
        connection.execute(
            update(api_keys)
            .where(api_keys.c.id == any_(bound_texts(keys)), api_keys.c.suspended_at.is_(None))
            .values(suspended_at=events.now, suspended_for=verification_id)
        )
        _audit_all(keys, connection)


def retry_refuted(job_id: str, *, connection: Connection, **values: Any) -> bool:
    """Queue a refuted job for its trial again, of the same machine.

    Only where trials of runners were its last: later replies of a model build on a false result.

    Args:
        connection: The transaction it is part of.
        values: Further columns of the job to set.

    Returns:
        Whether it was queued.
    """
    trials = and_(rollouts.c.job_id == job_id, rollouts.c.runner.is_not(None))
    lied = connection.execute(select(rollouts.c.final, rollouts.c.engine).where(trials)).all()
    if not lied or not all(row.final for row in lied):
        return False
    under_way = exists().where(
        verifications.c.job_id == job_id, verifications.c.state != VerificationState.DONE
    )
    moved = transition(
        jobs.c.id == job_id,
        jobs.c.audit == Audit.REFUTED,
        ~under_way,
        to=JobState.QUEUED,
        allowed_from={JobState.DONE},
        data={"why": "retry"},
        connection=connection,
        stage=Stage.SIMULATE,
        queue=simulate_queue(lied[0].engine),
        **{**REOPENED, **dict.fromkeys(_OF_JOB, null()), "ran_on_runner": False, **values},
    )
    if moved:
        undone = {**dict.fromkeys(_OF_TRIAL, null()), "audited": False}
        connection.execute(update(rollouts).where(trials).values(undone))
    return bool(moved)


def is_unproved(key_id: str, *, connection: Connection) -> bool:
    """Return whether a verification of a key's runner results was inconclusive."""
    unclear = exists().where(
        verifications.c.job_id == jobs.c.id, verifications.c.verdict == Verdict.INCONCLUSIVE
    )
    query = (
        select(rollouts.c.job_id)
        .join(jobs, jobs.c.id == rollouts.c.job_id)
        .where(rollouts.c.runner == key_id, jobs.c.audit == Audit.REQUIRED, unclear)
        .limit(1)
    )
    return connection.execute(query).first() is not None


def _runners(job_id: str, which: ColumnElement[bool], connection: Connection) -> list[str]:
    """Return the keys whose runners ran some trials of a job."""
    query = (
        select(rollouts.c.runner)
        .join(jobs, jobs.c.id == rollouts.c.job_id)
        .where(jobs.c.id == job_id, rollouts.c.runner.is_not(None), which)
        .distinct()
        .order_by(rollouts.c.runner)
    )
    return list(connection.execute(query).scalars())


def _audit_all(keys: Sequence[str], connection: Connection) -> None:
    """Request the verification of all trials by keys' runners, also of jobs that have not ended."""
    if not keys:
        return
    theirs = rollouts.c.runner == any_(bound_texts(keys))
    connection.execute(update(rollouts).where(theirs, ~rollouts.c.audited).values(audited=True))
    waiting = connection.execute(
        update(jobs)
        .where(
            jobs.c.id.in_(select(rollouts.c.job_id).where(theirs)),
            jobs.c.state == JobState.DONE,
            jobs.c.success.is_not(None),
            jobs.c.audit.is_(None),
        )
        .values(audit=Audit.REQUIRED)
        .returning(jobs.c.id)
    )
    require_audits(list(waiting.scalars()), connection=connection)
