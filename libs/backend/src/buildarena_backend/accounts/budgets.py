"""Budgets of sweeps and keys: limits on their jobs' spending, reserved before each request.

A job is paid for by the sweep that wants it and by the key that submitted that sweep. Before a
request its worker reserves what it may cost; when the reply is journaled, the reservation gives
way to what it did cost. So a budget is overspent by no more than the open requests cost above
what was reserved for them.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from decimal import Decimal
from typing import Any

from sqlalchemy import Connection, and_, func, literal, or_, select, update
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend.database.account_tables import MAX_USD, PAYS, budgets, reservations
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import value_of
from buildarena_backend.database.tables import jobs, journal, sweep_jobs
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.journal.journal import Usage
from buildarena_backend.leases.leases import Lease
from buildarena_backend.states import JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetLimits:
    """Limits on spending; None for no limit.

    Attributes:
        max_tokens: Input and output tokens together.
    """

    max_cost_usd: Decimal | None = None
    max_tokens: int | None = None
    max_requests: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget(BudgetLimits):
    """A budget and the spending so far.

    Attributes:
        id: Id of the sweep or key whose budget it is.
        spent_tokens: Input and output tokens used.
        lost_cost_usd: Upper bound of the cost of lost requests; only known payments are part of the
            cost.
        lost_requests: Requests whose replies no journal has: sent by a process that was killed, or
            answered after their lease had ended. Each may have been paid for.
    """

    id: str
    spent_cost_usd: Decimal
    spent_tokens: int
    spent_requests: int
    lost_cost_usd: Decimal
    lost_requests: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestCost:
    """Upper bounds of one model request's use."""

    cost_usd: Decimal
    tokens: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetShortage:
    """The reason why a request may not be sent.

    Attributes:
        limit: The limit that is reached, by its name in `BudgetLimits`.
        temporary: Whether open requests may release enough, so that waiting helps.
    """

    budget_id: str
    limit: str
    detail: str
    temporary: bool


class Budgets:
    """Sets, reads and reserves budgets."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def set(self, budget_id: str, limits: BudgetLimits, *, connection: Connection) -> None:
        """Give a sweep or key a budget, which includes its jobs' earlier spending.

        Args:
            limits: Limits on total spending, earlier spending included.
            connection: The transaction it is part of.
        """
        members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == budget_id)
        of_sweep = and_(journal.c.payer == budget_id, journal.c.job_id.in_(members))
        cost, tokens, requests = connection.execute(
            select(
                func.coalesce(func.sum(journal.c.cost_usd), 0),
                func.coalesce(func.sum(journal.c.input_tokens + journal.c.output_tokens), 0),
                func.count(),
            ).where(or_(of_sweep, journal.c.owner == budget_id))
        ).one()
        values = asdict(limits)
        statement = insert(budgets).values(
            id=budget_id,
            spent_cost_usd=cost,
            spent_tokens=tokens,
            spent_requests=requests,
            **values,
        )
        connection.execute(statement.on_conflict_do_update(index_elements=["id"], set_=values))

    def get(self, budget_id: str) -> Budget | None:
        """Return the budget of a sweep or key; None when it has none."""
        row = self._database.first_row(select(budgets).where(budgets.c.id == budget_id))
        return None if row is None else value_of(Budget, row)

    def reserve(self, lease: Lease, need: RequestCost) -> BudgetShortage | None:
        """Reserve the maximum cost of the job's next request, in all its budgets or in none.

        Returns:
            None when it is reserved, otherwise the shortage.

        Raises:
            StaleLeaseError: The lease is over, so its reservation would never be released.
        """
        job_id = lease.job.id
        # Before the budgets, as in every write under a lease; who ends the lease waits for it.
        held = (
            select(jobs.c.id)
            .where(
                jobs.c.id == job_id,
                jobs.c.lease_token == lease.token,
                jobs.c.state == JobState.RUNNING,
            )
            .with_for_update(read=True)
        )
        # Locked in the order of their ids, so that two jobs never wait for each other.
        locked = (
            select(budgets)
            .join(jobs, PAYS)
            .where(jobs.c.id == job_id)
            .order_by(budgets.c.id)
            .with_for_update(of=budgets)
        )
        with self._database.transaction() as connection:
            if connection.execute(held).first() is None:
                raise StaleLeaseError(job_id, lease.token)
            affected = [value_of(Budget, row) for row in connection.execute(locked)]
            for budget in affected:
                shortage = _shortage(budget, _totals(budget.id, job_id, connection), need)
                if shortage is not None:
                    return shortage
            if affected:
                fixed = {"job_id": job_id, "token": lease.token, **asdict(need)}
                statement = insert(reservations).values(
                    [{**fixed, "budget_id": budget.id} for budget in affected]
                )
                new = {name: statement.excluded[name] for name in ("token", "cost_usd", "tokens")}
                keys = ["job_id", "budget_id"]
                connection.execute(statement.on_conflict_do_update(index_elements=keys, set_=new))
        return None

    def charge_lost(self, lease: Lease, usage: Usage) -> None:
        """Count a reply that was paid for but came after the lease had ended."""
        paying = select(budgets.c.id).join(jobs, PAYS).where(jobs.c.id == lease.job.id)
        with self._database.transaction() as connection:
            connection.execute(
                update(budgets)
                .where(budgets.c.id.in_(paying))
                .values(
                    spent_cost_usd=func.least(budgets.c.spent_cost_usd + usage.cost_usd, MAX_USD),
                    spent_tokens=budgets.c.spent_tokens + usage.input_tokens + usage.output_tokens,
                    spent_requests=budgets.c.spent_requests + usage.requests,
                    lost_cost_usd=func.least(budgets.c.lost_cost_usd + usage.cost_usd, MAX_USD),
                    lost_requests=budgets.c.lost_requests + usage.requests,
                )
            )
            connection.execute(
                update(jobs)
                .where(jobs.c.id == lease.job.id)
                .values(lost_requests=jobs.c.lost_requests + usage.requests)
            )


def _totals(budget_id: str, job_id: str, connection: Connection) -> tuple[Decimal, int, int]:
    """Return dollars, tokens and requests reserved for the budget's other jobs."""
    row = connection.execute(
        select(
            func.coalesce(func.sum(reservations.c.cost_usd), literal(0)),
            func.coalesce(func.sum(reservations.c.tokens), literal(0)),
            func.count(),
        ).where(reservations.c.budget_id == budget_id, reservations.c.job_id != job_id)
    ).one()
    return Decimal(row[0]), int(row[1]), int(row[2])


def _shortage(
    budget: Budget, reserved: tuple[Decimal, int, int], need: RequestCost
) -> BudgetShortage | None:
    rows: tuple[tuple[str, Any, Any, Any, Any], ...] = (
        ("max_cost_usd", budget.max_cost_usd, budget.spent_cost_usd, reserved[0], need.cost_usd),
        ("max_tokens", budget.max_tokens, budget.spent_tokens, reserved[1], need.tokens),
        ("max_requests", budget.max_requests, budget.spent_requests, reserved[2], 1),
    )
    for name, limit, spent, reserved_now, requested in rows:
        # What needs nothing lacks nothing, even of a budget that was overspent a little.
        if limit is None or not requested or spent + reserved_now + requested <= limit:
            continue
        temporary = spent + requested <= limit
        detail = (
            f"budget of {budget.id}: {name} is {limit:,}, {spent:,} is spent, and the next "
            f"request may use {requested:,}"
        )
        return BudgetShortage(budget_id=budget.id, limit=name, detail=detail, temporary=temporary)
    return None
