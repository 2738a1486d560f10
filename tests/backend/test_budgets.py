"""Budgets: what is reserved, spent, lost and given back, and what a used-up one stops."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal

import pytest
from sqlalchemy import text
from support.jobs import cancel, claim, expire_leases, journal_entry, set_budget

from buildarena_backend.accounts.budgets import BudgetLimits, RequestCost
from buildarena_backend.errors import RefusedError, StaleLeaseError
from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.context import Context
from buildarena_backend.sweeps.sweeps import NewSweep

NEED = RequestCost(cost_usd=Decimal("0.30"), tokens=300)


def reply(sequence: int = 0, cost: str = "0.25") -> JournalEntry:
    usage = Usage(requests=1, input_tokens=200, output_tokens=50, cost_usd=Decimal(cost))
    return journal_entry(sequence, usage=usage)


@pytest.fixture
def sweep(context: Context, new_job) -> Callable[..., str]:
    """Stores a sweep of jobs with these seeds and, if given, a budget."""

    def make(*seeds: int, name: str = "sweep_a", owner: str | None = None, **limits: object) -> str:
        new = replace(new_job(*seeds), owner=owner, payer=name)
        if limits:
            set_budget(context, name, **limits)
        with context.store.database.transaction() as connection:
            context.store.jobs.add([new], connection=connection)
            made = NewSweep(id=name, name=name, spec={}, owner=owner)
            context.store.sweeps.add(made, new.job_ids, connection=connection)
        return name

    return make


@pytest.fixture
def reserve(context) -> Callable[..., object]:
    return lambda lease, need=NEED: context.store.budgets.reserve(lease, need)


def exhaust(context: Context, name: str) -> list[str]:
    lifecycle = context.store.lifecycle
    with lifecycle.command() as connection:
        return lifecycle.exhaust(name, "used up", connection=connection)


def reserved(context: Context, budget: str) -> int:
    with context.store.database.statement() as connection:
        query = text("SELECT count(*) FROM reservations WHERE budget_id = :budget")
        return connection.execute(query, {"budget": budget}).scalar_one()


def test_what_is_reserved_can_not_be_reserved_again(context, sweep, reserve) -> None:
    sweep(0, 1, 2, max_cost_usd=Decimal("0.70"))
    first, second, third = (claim(context) for _ in range(3))
    assert reserve(first) is None
    assert reserve(second) is None
    assert reserve(third).temporary, "open requests may cost less than was reserved"
    context.store.journal.append(first, reply(cost="0.05"))
    assert reserve(third) is None


@pytest.mark.parametrize(
    "limits", [{"max_cost_usd": Decimal("0.5")}, {"max_tokens": 500}, {"max_requests": 1}]
)
def test_a_used_up_budget_says_what_is_lacking(context, sweep, reserve, limits) -> None:
    name = sweep(0, **limits)
    lease = claim(context)
    assert reserve(lease) is None
    context.store.journal.append(lease, reply())
    shortage = reserve(lease)
    assert (shortage.temporary, shortage.budget_id) == (False, name)
    assert next(iter(limits)) in shortage.detail
    budget = context.store.budgets.get(name)
    assert (budget.spent_cost_usd, budget.spent_tokens) == (Decimal("0.250000"), 250)
    assert budget.spent_requests == 1


def test_a_key_pays_beside_its_sweep(context, sweep, reserve) -> None:
    sweep(0, owner="key_k", max_cost_usd=Decimal(10))
    set_budget(context, "key_k", max_requests=1)
    lease = claim(context)
    assert reserve(lease) is None
    context.store.journal.append(lease, reply())
    assert reserve(lease).budget_id == "key_k"
    for name in ("key_k", "sweep_a"):
        assert context.store.budgets.get(name).spent_requests == 1


def test_a_budget_that_comes_later_counts_what_was_spent(context, sweep) -> None:
    name = sweep(0, owner="key_k")
    context.store.journal.append(claim(context), reply())
    for payer in (name, "key_k"):
        set_budget(context, payer, max_requests=5)
        budget = context.store.budgets.get(payer)
        assert (budget.spent_requests, budget.spent_tokens) == (1, 250), payer


def test_the_end_of_a_hold_gives_its_reservation_back(context, sweep, reserve) -> None:
    name = sweep(0, 1, max_requests=1)
    first, second = claim(context), claim(context)
    assert reserve(first) is None
    assert reserve(second) is not None
    context.store.leases.hand_back(first)
    assert reserve(second) is None
    cancel(context, second.job.id)
    assert reserve(claim(context)) is None
    lost = context.store.budgets.get(name).lost_requests
    assert (lost, context.store.sweeps.progress(name).lost_requests) == (0, 0)


def test_a_reply_that_came_too_late_was_paid_for(context, sweep) -> None:
    name = sweep(0, max_requests=5)
    lease = claim(context)
    cancel(context, lease.job.id)
    with pytest.raises(StaleLeaseError):
        context.store.journal.append(lease, reply())
    context.store.budgets.charge_lost(lease, reply().usage)
    budget = context.store.budgets.get(name)
    assert (budget.spent_requests, budget.lost_requests) == (1, 1)
    assert budget.lost_cost_usd == budget.spent_cost_usd == Decimal("0.25")
    assert context.store.sweeps.progress(name).lost_requests == 1


def test_a_reply_that_was_lost_in_a_kill_is_a_figure_of_its_own(context, sweep, reserve) -> None:
    name = sweep(0, 1, max_requests=9)
    asking = claim(context)
    claim(context)
    assert reserve(asking) is None
    expire_leases(context)
    assert len(context.store.leases.recover()) == 2
    budget = context.store.budgets.get(name)
    assert (budget.lost_requests, budget.lost_cost_usd) == (1, NEED.cost_usd)
    assert (budget.spent_requests, budget.spent_cost_usd) == (0, 0)
    # Of a job without a request under way nobody can tell: its figure is at most.
    assert context.store.sweeps.progress(name).lost_requests == 2


def test_who_lost_the_job_reserves_nothing(context, sweep, reserve) -> None:
    name = sweep(0, 1, 2, max_requests=9)
    handed_back, cancelled, lost = (claim(context) for _ in range(3))
    context.store.leases.hand_back(handed_back)
    cancel(context, cancelled.job.id)
    expire_leases(context)
    assert context.store.leases.recover() == [lost.job.id]
    claim(context)
    for lease in (handed_back, cancelled, lost):
        with pytest.raises(StaleLeaseError):
            reserve(lease)
    assert reserved(context, name) == 0


def test_a_lease_that_ends_meanwhile_leaves_no_reservation(context, sweep, reserve) -> None:
    """A worker that was taken for dead reserves at the moment in which its job is taken away."""
    name = sweep(*range(12), max_requests=99)
    leases = [claim(context) for _ in range(12)]

    def try_to_reserve(lease: Lease) -> None:
        with suppress(StaleLeaseError):
            reserve(lease)

    with ThreadPoolExecutor(8) as pool:
        done = [pool.submit(try_to_reserve, lease) for lease in leases]
        done += [pool.submit(cancel, context, lease.job.id) for lease in leases]
        for one in done:
            one.result()
    assert reserved(context, name) == 0


def test_a_stopped_sweep_passes_on_what_another_wants_and_holds_the_rest(context, sweep) -> None:
    sweep(0, 1, max_requests=1)
    sweep(1, 2, name="sweep_b", owner="key_b")
    assert exhaust(context, "sweep_a") == ["sweep_a"]
    jobs = {job.seed: job for job in context.store.jobs.page(limit=10)}
    told = [(job.state, job.payer, job.owner) for _, job in sorted(jobs.items())]
    assert told == [("on_hold", "sweep_a", None), *[("queued", "sweep_b", "key_b")] * 2]
    assert context.store.sweeps.get("sweep_a").state == "budget_exhausted"
    context.store.lifecycle.resume("sweep_a")
    assert context.store.jobs.get(jobs[0].id).state == "queued"
    exhaust(context, "sweep_a")
    sweep(0, name="sweep_c")  # who wants it pays
    job = context.store.jobs.get(jobs[0].id)
    assert (job.state, job.payer) == ("queued", "sweep_c")


def test_what_needs_nothing_lacks_nothing_of_an_overspent_budget(context, sweep, reserve) -> None:
    sweep(0, max_cost_usd=Decimal("0.50"))
    lease = claim(context)
    context.store.journal.append(lease, reply(cost="0.75"))
    assert reserve(lease, RequestCost(cost_usd=Decimal(), tokens=300)) is None
    assert reserve(lease).limit == "max_cost_usd"


def test_a_budget_is_raised_in_every_state_but_cancelled(context, sweep) -> None:
    name = sweep(0, max_requests=1)
    lifecycle, sweeps = context.store.lifecycle, context.store.sweeps

    def state() -> tuple[str, dict[str, int]]:
        return sweeps.get(name).state, sweeps.progress(name).stages

    lifecycle.pause(name)
    lifecycle.set_budget(name, BudgetLimits(max_requests=3))
    assert state() == ("paused", {"construct on_hold": 1})
    lifecycle.resume(name)
    exhaust(context, name)
    assert state() == ("budget_exhausted", {"construct on_hold": 1})
    lifecycle.set_budget(name, BudgetLimits(max_requests=4))
    assert state() == ("active", {"construct queued": 1})
    assert context.store.budgets.get(name).max_requests == 4
    lifecycle.cancel(name)
    with pytest.raises(RefusedError, match="is cancelled"):
        lifecycle.set_budget(name, BudgetLimits(max_requests=5))


def test_many_workers_together_never_reserve_more_than_there_is(context, sweep, reserve) -> None:
    name = sweep(*range(8), owner="key_k", max_requests=20)
    set_budget(context, "key_k", max_requests=25)
    leases = [claim(context) for _ in range(8)]

    def work(lease: Lease) -> None:
        for sequence in range(5):
            while (shortage := reserve(lease)) is not None:
                if not shortage.temporary:
                    return
            context.store.journal.append(lease, reply(sequence))

    with ThreadPoolExecutor(len(leases)) as threads:
        list(threads.map(work, leases))
    assert context.store.budgets.get(name).spent_requests == 20
