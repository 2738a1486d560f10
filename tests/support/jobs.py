"""Jobs that are brought to a point of their lives by hand, without a worker."""

from typing import Any

from sqlalchemy import text
from sqlalchemy.sql import Executable

from buildarena_backend.accounts.budgets import BudgetLimits
from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.context import Context
from buildarena_backend.results.results import JobScore


def execute(context: Context, statement: str | Executable, values: Any = None) -> None:
    """One statement in a transaction of its own."""
    done = text(statement) if isinstance(statement, str) else statement
    with context.store.database.transaction() as connection:
        connection.execute(done, values)


def expire_leases(context: Context) -> None:
    """Every lease is over."""
    execute(context, "UPDATE leases SET expires_at = now() - interval '1 hour'")


def claim(context: Context, owner: str = "w", *, job: str | None = None, **more: Any) -> Lease:
    """Claims what waits longest: the job, if one is named."""
    if job is not None:
        execute(context, "UPDATE jobs SET created_at = 'epoch' WHERE id = :id", {"id": job})
    lease = context.store.leases.claim("construct", owner=owner, **more)
    assert lease is not None
    return lease


def journal_entry(sequence: int = 0, **changes: Any) -> JournalEntry:
    """A reply to a builder that says and costs nothing."""
    usual = {"stage": "build", "role": "builder", "request_hash": "h", "reply": {}}
    usual |= {"usage": Usage(), "latency_s": 0.1}
    return JournalEntry(sequence=sequence, **{**usual, **changes})


def finish(
    context: Context,
    lease: Lease,
    outcome: str = "success",
    indicator: float = 0.0,
    *,
    columns: dict[str, Any] | None = None,
    **score: Any,
) -> str:
    """Ends a leased job with a score, and further columns of its row; its id."""
    share = float(outcome == "success")
    made = JobScore(outcome=outcome, success=share, indicator=indicator, **score)
    with context.store.database.transaction() as connection:
        context.store.results.finish(lease, made, connection=connection, **(columns or {}))
    return lease.job.id


def end_all(context: Context) -> None:
    """Every job has ended without a success."""
    execute(
        context,
        "UPDATE jobs SET state = 'done', outcome = 'unsuccessful', success = 0,"
        " indicator = 0, metrics = '{}', finished_at = now()",
    )


def cancel(context: Context, job_id: str) -> None:
    with context.store.database.transaction() as connection:
        context.store.jobs.cancel([job_id], connection=connection)


def attach(
    context: Context, job_id: str, files: dict[str, bytes], media_type: str = "application/json"
) -> dict[str, str]:
    """Stores files as a job's artifacts; their hashes by name."""
    kept = {name: context.artifacts.put(data, media_type) for name, data in files.items()}
    with context.store.database.transaction() as connection:
        context.store.results.attach(job_id, kept, connection=connection)
    return {name: info.hash for name, info in kept.items()}


def set_budget(context: Context, payer: str, **limits: Any) -> None:
    with context.store.database.transaction() as connection:
        context.store.budgets.set(payer, BudgetLimits(**limits), connection=connection)


def report_worker(context: Context, name: str, *queues: str, **more: Any) -> None:
    """A worker says that it is there and serves these queues."""
    kind = queues[0].partition(".")[0]
    facts = {"kind": kind, "queues": queues, "host": "here", "pid": 1, "versions": {}, **more}
    context.store.workers.report(worker_id=name, **facts)
