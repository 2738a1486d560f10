"""The tables. One job is one row; its unique key makes a result impossible to have twice."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    DateTime,
    Double,
    ForeignKey,
    Identity,
    Index,
    Integer,
    MetaData,
    Numeric,
    Table,
    Text,
    func,
    text,
)
from sqlalchemy.dialects.postgresql import JSON, JSONB

from buildarena_backend.states import TURN, JobState, VerificationState

metadata = MetaData(
    naming_convention={
        "pk": "pk_%(table_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
    }
)


def texts(*names: str) -> list[Column[str]]:
    """Return texts that every row has."""
    return [Column(name, Text, nullable=False) for name in names]


def some_texts(*names: str) -> list[Column[str]]:
    """Return texts that a row may lack."""
    return [Column(name, Text) for name in names]


def times(*names: str) -> list[Column[object]]:
    """Return times with their zones; empty at first."""
    return [Column(name, DateTime(timezone=True)) for name in names]


def time_made(name: str) -> Column[object]:
    """Return the time when a row was made."""
    zoned = DateTime(timezone=True)
    return Column(name, zoned, nullable=False, server_default=func.clock_timestamp())


def counts(*names: str) -> list[Column[int]]:
    """Return numbers of something, 0 at first."""
    return [Column(name, BigInteger, nullable=False, server_default=text("0")) for name in names]


jobs = Table(
    "jobs",
    metadata,
    Column("id", Text, primary_key=True),
    # What the job is: these columns never change.
    *texts("task", "task_version", "model", "model_hash"),
    Column("model_config", JSONB, nullable=False),
    *texts("track"),
    Column("track_config", JSONB, nullable=False),
    Column("seed", BigInteger, nullable=False),
    # Seeds parameters hidden from its builder, so no response has it; older jobs have none.
    Column("randomization_seed", BigInteger),
    Column("limits", JSONB, nullable=False, server_default=text("'{}'::jsonb")),
    # Whose it is: the API key that submitted it, and the sweep whose budget pays for it.
    *some_texts("owner", "payer"),
    # The span of its submission, which everything done for it is a part of.
    *some_texts("traceparent"),
    # Where it is.
    *texts("stage", "queue", "state"),
    *some_texts("outcome", "reason", "detail"),
    Column("faults", Integer, nullable=False, server_default=text("0")),
    *some_texts("lease_owner"),
    Column("lease_token", BigInteger, nullable=False, server_default=text("0")),
    time_made("available_at"),
    # What it scored.
    Column("success", Double),
    Column("indicator", Double),
    Column("metrics", JSONB),
    Column("flags", JSONB),
    Column("manifest", JSONB),
    # What it cost.
    *counts(
        "requests",
        "lost_requests",
        "input_tokens",
        "output_tokens",
        "cached_tokens",
        "reasoning_tokens",
    ),
    Column("cost_usd", Numeric(14, 6), nullable=False, server_default=text("0")),
    *counts("actions", "refused_actions"),
    Column("refusals", JSONB),
    # Whether a runner ran one of its trials; whether its score waits for a verification, and the
    # verdict and time of the last conclusive one.
    Column("ran_on_runner", Boolean, nullable=False, server_default=text("false")),
    *some_texts("audit"),
    *times("verified_at"),
    time_made("created_at"),
    *times("started_at", "finished_at"),
    # What makes a job unique is in its id: see `NewJobs`.
)
_QUEUED = jobs.c.state == JobState.QUEUED
Index(
    "ix_jobs_waiting",
    jobs.c.queue,
    func.coalesce(jobs.c.owner, text("''")),
    jobs.c.created_at,
    jobs.c.id,
    postgresql_where=_QUEUED,
)
Index("ix_jobs_recovered", jobs.c.queue, postgresql_where=_QUEUED & (jobs.c.faults > 0))
Index("ix_jobs_running", jobs.c.id, postgresql_where=jobs.c.state == JobState.RUNNING)
Index("ix_jobs_cell", jobs.c.track, jobs.c.task, jobs.c.model_hash, jobs.c.model)
# One for each order of lists, and for what lists are narrowed down by.
Index("ix_jobs_created", jobs.c.created_at, jobs.c.id)
Index("ix_jobs_finished", jobs.c.finished_at, jobs.c.id)
Index("ix_jobs_indicator", jobs.c.indicator, jobs.c.id)
Index("ix_jobs_cost", jobs.c.cost_usd, jobs.c.id, postgresql_where=jobs.c.state == JobState.DONE)
Index("ix_jobs_task", jobs.c.task, jobs.c.id)
Index("ix_jobs_model", jobs.c.model, jobs.c.id)
Index("ix_jobs_outcome", jobs.c.outcome, jobs.c.id, postgresql_where=jobs.c.outcome.is_not(None))
Index("ix_jobs_reason", jobs.c.reason, jobs.c.id, postgresql_where=jobs.c.reason.is_not(None))
Index("ix_jobs_detail", jobs.c.id, postgresql_where=jobs.c.detail.is_not(None))
Index(
    "ix_jobs_flags",
    jobs.c.flags,
    postgresql_using="gin",
    postgresql_ops={"flags": "jsonb_path_ops"},
    postgresql_where=jobs.c.flags.is_not(None),
)
Index("ix_jobs_oldest", jobs.c.queue, jobs.c.created_at, jobs.c.id, postgresql_where=_QUEUED)
Index("ix_jobs_available", jobs.c.queue, jobs.c.available_at, postgresql_where=_QUEUED)
Index("ix_jobs_payer", jobs.c.payer, postgresql_where=jobs.c.state != JobState.DONE)
Index("ix_jobs_owner", jobs.c.owner, postgresql_where=jobs.c.state != JobState.DONE)

# Until when leases are valid. Heartbeats change nothing else: a narrow row, no column of an index.
leases = Table(
    "leases",
    metadata,
    Column("job_id", Text, primary_key=True),
    Column("token", BigInteger, nullable=False),
    time_made("expires_at"),
)

sweeps = Table(
    "sweeps",
    metadata,
    Column("id", Text, primary_key=True),
    *texts("name"),
    Column("spec", JSONB, nullable=False),
    *texts("state"),
    *some_texts("owner", "request_hash"),
    Column("jobs_hash", Text, index=True),
    time_made("created_at"),
)

sweep_jobs = Table(
    "sweep_jobs",
    metadata,
    Column("sweep_id", Text, ForeignKey("sweeps.id", ondelete="CASCADE"), primary_key=True),
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    # False when the owner cancelled just this job.
    Column("claimed", Boolean, nullable=False, server_default=text("true")),
    Index("ix_sweep_jobs_job", "job_id"),
)

# Keys that want a job, in addition to sweeps; the operator's name is empty.
job_claims = Table(
    "job_claims",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("owner", Text, primary_key=True),
)

tasks = Table(
    "tasks",
    metadata,
    Column("name", Text, primary_key=True),
    Column("version", Text, primary_key=True),
    *texts("document"),
    *some_texts("owner"),
    time_made("created_at"),
)

attempts = Table(
    "attempts",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("token", BigInteger, primary_key=True),
    *texts("stage", "worker"),
    time_made("started_at"),
    *times("ended_at"),
    *some_texts("result", "detail"),
)

journal = Table(
    "journal",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("sequence", Integer, primary_key=True),
    Column("token", BigInteger, nullable=False),
    *texts("stage", "role", "request_hash"),
    # JSON keeps the order of keys, which replies are replayed with; JSONB does not.
    Column("reply", JSON, nullable=False),
    *counts("input_tokens", "output_tokens", "cached_tokens", "reasoning_tokens"),
    Column("cost_usd", Numeric(14, 6), nullable=False, server_default=text("0")),
    Column("latency_s", Double, nullable=False),
    Column("tries", Integer, nullable=False, server_default=text("1")),
    *some_texts("provider_request_id", "system_fingerprint"),
    # Why earlier sendings of the request failed, a text each.
    Column("failures", JSONB(none_as_null=True)),
    # Who paid for it: a job may be handed over to another sweep later.
    *some_texts("payer", "owner"),
    time_made("created_at"),
    # Messages to the role since its last reply; earlier releases did not store them.
    Column("prompt_messages", JSON(none_as_null=True)),
)
# The words of transcripts, for searches through all of them: what models said, what they and
# agents were answered. Only the beginning of very long texts: a row must fit into the index.
REPLY_WORDS = text("to_tsvector('english'::regconfig, \"left\"(reply ->> 'text'::text, 100000))")
FEEDBACK_WORDS = text(
    "(\nCASE\n    WHEN length(data::text) < 100000 THEN to_tsvector('english'::regconfig, "
    "jsonb_path_query_array(data, '$.\"results\"[*][2]'::jsonpath))\n    "
    "ELSE NULL::tsvector\nEND)"
)
ANSWER_WORDS = text("to_tsvector('english'::regconfig, \"left\"(feedback, 100000))")
Index("ix_journal_words", REPLY_WORDS, postgresql_using="gin", _table=journal)
Index("ix_journal_owner", journal.c.owner, postgresql_where=journal.c.owner.is_not(None))

external_calls = Table(
    "external_calls",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("sequence", Integer, primary_key=True),
    *texts("machine", "tool"),
    Column("arguments", JSON, nullable=False),
    Column("ok", Boolean, nullable=False),
    *some_texts("reason"),
    *texts("feedback"),
    time_made("at"),
)

Index("ix_external_calls_words", ANSWER_WORDS, postgresql_using="gin", _table=external_calls)

rollouts = Table(
    "rollouts",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("final", Boolean, nullable=False),
    *texts("engine", "machine_hash"),
    Column("controls", JSON),
    # Of the varied world in which it is done; none in the exact one.
    Column("seed", BigInteger),
    Column("success", Boolean),
    Column("indicator", Double),
    Column("metrics", JSON),
    Column("flags", JSONB),
    *some_texts("trajectory_hash"),
    Column("trace", JSON),
    Column("versions", JSONB),
    Column("annotations", JSONB(none_as_null=True)),
    Column("wall_s", Double),
    # The key whose runner ran it, if one did, and whether its job is verified before it counts.
    *some_texts("runner"),
    Column("audited", Boolean, nullable=False, server_default=text("false")),
    time_made("created_at"),
    *times("finished_at"),
)
Index("ix_rollouts_runner", rollouts.c.runner, postgresql_where=rollouts.c.runner.is_not(None))

artifacts = Table(
    "artifacts",
    metadata,
    Column("hash", Text, primary_key=True),
    *texts("media_type"),
    Column("size", BigInteger, nullable=False),
    time_made("created_at"),
)

job_artifacts = Table(
    "job_artifacts",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("name", Text, primary_key=True),
    Column("hash", Text, ForeignKey("artifacts.hash"), nullable=False),
)

verifications = Table(
    "verifications",
    metadata,
    Column("id", Text, primary_key=True),
    Column("job_id", Text, ForeignKey("jobs.id"), nullable=False),
    *texts("state"),
    Column("report", JSONB),
    *some_texts("verdict", "owner"),
    time_made("created_at"),
    *times("claimed_at", "finished_at"),
)
# Equal verifications are one.
Index(
    "ix_verifications_open",
    verifications.c.job_id,
    unique=True,
    postgresql_where=verifications.c.state != VerificationState.DONE,
)

# Written by triggers on jobs, so that no writer can forget it.
board_changes = Table(
    "board_changes",
    metadata,
    Column("id", BigInteger, Identity(), primary_key=True),
    # The transaction that changed the job: ids alone become visible out of order.
    Column("transaction", BigInteger, nullable=False),
    *texts("job_id", "track", "task"),
    # With track and task the cell; null when no cell changed, or before there were these columns.
    *some_texts("task_version", "configuration"),
    *texts("kind"),
)
Index("ix_board_changes_transaction", board_changes.c.transaction)

events = Table(
    "events",
    metadata,
    Column("id", BigInteger, Identity(), primary_key=True),
    *some_texts("job_id", "sweep_id"),
    *texts("kind"),
    Column("data", JSONB, nullable=False),
    time_made("at"),
)
Index("ix_events_job", events.c.job_id, events.c.id)
Index("ix_events_sweep", events.c.sweep_id, events.c.id)
Index(
    "ix_events_words",
    FEEDBACK_WORDS,
    postgresql_using="gin",
    postgresql_where=events.c.kind == TURN,
    _table=events,
)

workers = Table(
    "workers",
    metadata,
    Column("id", Text, primary_key=True),
    *texts("kind"),
    Column("queues", JSONB, nullable=False),
    *texts("host"),
    Column("pid", Integer, nullable=False),
    Column("versions", JSONB, nullable=False),
    time_made("started_at"),
    time_made("last_heartbeat_at"),
    Column("peak_memory_bytes", BigInteger),
    Column("clock_skew_s", Double),
)

# One row: since which schema programs work with this one; migrations write it.
schema_compatibility = Table(
    "schema_compatibility", metadata, Column("since", Text, primary_key=True)
)
