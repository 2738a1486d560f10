from dataclasses import replace
from decimal import Decimal

import pytest
from sqlalchemy.exc import IntegrityError
from support.jobs import claim, execute, journal_entry, set_budget

from buildarena_store import JournalEntry, Usage
from buildarena_store.account_tables import MAX_USD

USAGE = Usage(
    requests=1, input_tokens=100, output_tokens=10, cached_tokens=40, cost_usd=Decimal("0.25")
)


def entry(sequence: int) -> JournalEntry:
    return journal_entry(sequence, reply={"text": "ü"}, usage=USAGE, tries=2)


def test_a_reply_and_its_cost_are_written_together(context, add) -> None:
    (job_id,) = add(1)
    lease = claim(context)
    context.store.journal.append(lease, entry(0))
    context.store.journal.append(lease, entry(1))
    with pytest.raises(IntegrityError):
        context.store.journal.append(lease, entry(1))
    job = context.store.jobs.get(job_id)
    assert (job.requests, job.input_tokens, job.cost_usd) == (2, 200, Decimal("0.500000"))
    read = context.store.journal.read(job_id)
    assert [e.sequence for e in read] == [0, 1]
    assert read[0].reply == {"text": "ü"}
    assert read[0].usage == USAGE


@pytest.mark.parametrize("finish", ["garbage", "out_of_time"])
def test_what_is_no_answer_is_paid_for_and_no_progress(context, add, finish) -> None:
    (job_id,) = add(1)
    lease = claim(context)
    execute(context, "UPDATE jobs SET faults = 3")
    context.store.journal.append(lease, replace(entry(0), reply={"text": "", "finish": finish}))
    job = context.store.jobs.get(job_id)
    assert (job.faults, job.requests, job.cost_usd) == (3, 1, Decimal("0.25"))
    context.store.journal.append(lease, replace(entry(1), reply={"text": "", "finish": "stop"}))
    assert context.store.jobs.get(job_id).faults == 0


def test_sums_that_a_provider_claims_never_overflow(context, add) -> None:
    (job_id,) = add(1)
    execute(context, "UPDATE jobs SET payer = 'sweep_x'")
    set_budget(context, "sweep_x", max_requests=99)
    lease = claim(context)
    most = Usage(requests=1, input_tokens=10**7, cost_usd=Decimal(60_000_000))
    for sequence in range(3):
        context.store.journal.append(lease, replace(entry(sequence), usage=most))
    context.store.budgets.charge_lost(lease, most)
    assert context.store.jobs.get(job_id).cost_usd == MAX_USD
    budget = context.store.budgets.get("sweep_x")
    assert (budget.spent_cost_usd, budget.spent_requests) == (MAX_USD, 4)
