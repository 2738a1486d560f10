"""The tables of accounts: names, keys, budgets and reservations."""

from __future__ import annotations

from typing import Final

from sqlalchemy import (
    BigInteger,
    Column,
    Computed,
    ForeignKey,
    Index,
    Numeric,
    Table,
    Text,
    and_,
    func,
    or_,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.tables import (
    counts,
    jobs,
    metadata,
    some_texts,
    texts,
    time_made,
    times,
)
from buildarena_backend.states import BUILTIN_PROVIDER

MAX_USD = 99_999_999
"""Sums stop here: what a provider claims to have used must not make a column overflow."""
FOLD = (
    "replace(replace(translate(lower(regexp_replace({}, '[._-]', '', 'g')), '01i5', 'olls'),"
    " 'rn', 'm'), 'vv', 'w')"
)
"""SQL of a name's folded form: names that people may take for each other have the same one."""
# Names that belong to the key that first used them, with all that look like them; the operator's
# key is null.
names = Table(
    "names",
    metadata,
    Column("kind", Text, primary_key=True),
    Column("name", Text, primary_key=True),
    *some_texts("owner"),
    Column("folded", Text, Computed(FOLD.format("name"), persisted=True)),
    Index("ix_names_folded", "folded"),
)

api_keys = Table(
    "api_keys",
    metadata,
    Column("id", Text, primary_key=True),
    *texts("name"),
    Column("secret_hash", Text, nullable=False, unique=True),
    Column("previous_hash", Text, unique=True),
    *times("previous_until"),
    Column("scopes", JSONB, nullable=False),
    # Of a runner key: whose runners may lease these simulators' jobs, of these keys or of all.
    Column("simulators", JSONB(none_as_null=True)),
    Column("job_owners", JSONB(none_as_null=True)),
    time_made("created_at"),
    *times("expires_at", "revoked_at", "used_at"),
    # Of a runner key: since when its runners may do nothing, and the verification that refuted one.
    *times("suspended_at"),
    *some_texts("suspended_for"),
)

# A row's id is that of the sweep or key whose budget it is.
budgets = Table(
    "budgets",
    metadata,
    Column("id", Text, primary_key=True),
    Column("max_cost_usd", Numeric(14, 6)),
    Column("max_tokens", BigInteger),
    Column("max_requests", BigInteger),
    Column("spent_cost_usd", Numeric(14, 6), nullable=False, server_default=text("0")),
    *counts("spent_tokens", "spent_requests"),
    Column("lost_cost_usd", Numeric(14, 6), nullable=False, server_default=text("0")),
    *counts("lost_requests"),
)

# What one open model request may cost: a job has one at a time.
reservations = Table(
    "reservations",
    metadata,
    Column("job_id", Text, ForeignKey("jobs.id"), primary_key=True),
    Column("budget_id", Text, ForeignKey("budgets.id", ondelete="CASCADE"), primary_key=True),
    Column("token", BigInteger, nullable=False),
    Column("cost_usd", Numeric(14, 6), nullable=False),
    Column("tokens", BigInteger, nullable=False),
    Index("ix_reservations_budget", "budget_id"),
)

NEEDS_BUDGET: Final = (
    func.coalesce(jobs.c.model_config["provider"].as_string(), "") != BUILTIN_PROVIDER
)
"""Whether a job's requests count in budgets: those of built-in models cost nothing."""
PAYS: Final = and_(
    or_(budgets.c.id == jobs.c.payer, budgets.c.id == jobs.c.owner),
    NEEDS_BUDGET,
)
"""Whether a budget pays for a job."""
