"""Jobs, their leases and their journal: one worker at a time, and late writers write nothing."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import timedelta
from decimal import Decimal

import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError
from support.jobs import cancel, claim, execute, expire_leases, finish, journal_entry, set_budget

from buildarena_backend.database.account_tables import MAX_USD
from buildarena_backend.database.tables import jobs
from buildarena_backend.errors import StaleLeaseError, UnknownIdError
from buildarena_backend.jobs.job import NewJobs
from buildarena_backend.journal.journal import Usage
from buildarena_backend.journal.turns import TurnResult
from buildarena_backend.leases.leases import Lease, Leases
from buildarena_backend.process.context import Context

USAGE = Usage(
    requests=1, input_tokens=100, output_tokens=10, cached_tokens=40, cost_usd=Decimal("0.25")
)
ENTRY = journal_entry(0, reply={"text": "ü"}, usage=USAGE, tries=2)


def scalar(context: Context, query: str, **values: object) -> object:
    with context.store.database.statement() as connection:
        return connection.execute(text(query), values).scalar_one()


def test_a_job_is_leased_to_one_worker_at_a_time(context, add) -> None:
    add(*range(20))
    taken: list[str] = []

    def work(owner: str) -> None:
        while lease := context.store.leases.claim("construct", owner=owner):
            taken.append(lease.job.id)

    threads = [threading.Thread(target=work, args=(f"w{n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(taken) == 20
    assert len(set(taken)) == 20


def test_a_recovered_job_is_taken_before_older_ones(context, add) -> None:
    first, second, third = add(1, 2, 3)
    assert {claim(context, job=id_).job.id for id_ in (third, second)} == {second, third}
    expire_leases(context)
    assert set(context.store.leases.recover()) == {second, third}
    execute(context, "UPDATE jobs SET created_at = 'epoch' WHERE id = :id", {"id": first})
    assert {claim(context).job.id, claim(context).job.id} == {second, third}
    assert claim(context).job.id == first
    assert context.store.leases.claim("construct", owner="w") is None


def stale_and_fresh(context: Context) -> tuple[Lease, Lease]:
    """The lease of a worker that was too slow, and that of the one which has its job now."""
    stale = claim(context, "slow")
    expire_leases(context)
    context.store.leases.recover()
    return stale, claim(context, "quick")


def test_a_stale_lease_can_write_nothing(context, add) -> None:
    (job_id,) = add(1)
    stale, fresh = stale_and_fresh(context)
    assert fresh.token > stale.token
    for write in (
        lambda: context.store.journal.append(stale, journal_entry()),
        lambda: finish(context, stale),
        lambda: context.store.leases.hand_back(stale),
    ):
        with pytest.raises(StaleLeaseError):
            write()
    assert context.store.journal.read(job_id) == []
    for lease in (stale, fresh):
        turn = TurnResult(index=0, sequence=0, sub_structure=None, results=[])
        context.store.turns.append(lease, turn)
    told = "SELECT count(*) FROM events WHERE job_id = :id AND kind = 'turn'"
    assert scalar(context, told, id=job_id) == 1
    finish(context, fresh, indicator=7.5)
    for again in (lambda: finish(context, fresh), lambda: context.store.leases.hand_back(fresh)):
        with pytest.raises(StaleLeaseError):
            again()
    job = context.store.jobs.get(job_id)
    assert (job.outcome, job.indicator) == ("success", 7.5)
    assert context.store.leases.claim("construct", owner="w") is None


def test_heartbeats_keep_a_lease_and_say_of_lost_ones(context, add) -> None:
    add(1, 2)
    kept, lost = claim(context), claim(context)
    cancel(context, lost.job.id)
    expires = "SELECT expires_at FROM leases WHERE job_id = :id"
    before = scalar(context, expires, id=kept.job.id)
    assert context.store.leases.held([kept, lost]) == {kept.job.id: False}
    assert scalar(context, expires, id=kept.job.id) == before, "looking renews nothing"
    assert context.store.leases.heartbeat([kept, lost]) == {kept.job.id: False}
    assert scalar(context, expires, id=kept.job.id) > before
    with pytest.raises(StaleLeaseError):
        finish(context, lost)
    assert context.store.jobs.get(lost.job.id).outcome == "cancelled"
    context.store.leases.duration = timedelta(seconds=0.05)
    context.store.leases.heartbeat([kept])
    time.sleep(0.1)
    assert context.store.leases.recover() == [kept.job.id]


def test_a_job_that_keeps_losing_its_workers_is_given_up_unless_it_gets_on(context, add) -> None:
    losing, going = add(1, 2)
    execute(context, "UPDATE jobs SET created_at = 'epoch' WHERE id = :id", {"id": losing})
    leases = Leases(context.store.database, duration_s=1, max_faults=2)
    for sequence in range(4):
        if sequence < 2:
            assert leases.claim("construct", owner="w").job.id == losing
        lease = leases.claim("construct", owner="w")
        assert lease.job.id == going
        context.store.journal.append(lease, journal_entry(sequence))
        expire_leases(context)
        leases.recover()
    job = context.store.jobs.get(losing)
    assert (job.outcome, job.reason, job.success) == ("errored", "lost_worker", None)
    assert [attempt.result for attempt in context.store.jobs.attempts(losing)] == ["lost", "lost"]
    assert context.store.jobs.get(going).state == "queued"


def test_a_fault_waits_before_the_next_attempt_and_handing_back_is_none(context, add) -> None:
    (job_id,) = add(1)
    context.store.leases.hand_back(claim(context))
    job = context.store.jobs.get(job_id)
    assert (job.state, job.faults) == ("queued", 0)
    lease = claim(context)
    assert context.store.leases.fault(lease, "outage", delay_s=30, reason="provider_outage")
    assert context.store.leases.claim("construct", owner="w") is None
    assert context.store.waiting.queues(10) == {}
    kinds = [event.kind for event in context.store.events.after(0, job_id=job_id)]
    assert kinds[:4] == ["queued", "running", "queued", "running"]


def test_queues_are_counted_up_to_a_number(context, add) -> None:
    ids = add(*range(20))
    execute(context, "UPDATE jobs SET queue = 'simulate.x' WHERE id = :id", {"id": ids[0]})
    assert context.store.waiting.queues(5) == {"construct": 5, "simulate.x": 1}


def owned(context: Context, add, owners: list[str | None]) -> list[str]:
    ids: list[str] = add(*range(len(owners)))
    values = [{"owner": owner, "id": id_} for id_, owner in zip(ids, owners, strict=True)]
    execute(context, "UPDATE jobs SET owner = :owner WHERE id = :id", values)
    return ids


def test_owners_take_turns(context, add) -> None:
    owned(context, add, ["a"] * 4 + ["b"] * 2 + [None, "c"])
    taken, last = [], None
    for _ in range(8):
        lease = context.store.leases.claim("construct", owner="w", last=last)
        last = lease.job.owner or ""
        taken.append(last)
    assert taken == ["", "a", "b", "c", "a", "b", "a", "a"]


@pytest.mark.parametrize("faults", [0, 1])
def test_jobs_of_full_owners_wait(context, add, faults) -> None:
    _, b, operators = owned(context, add, ["a", "b", None])
    execute(context, "UPDATE jobs SET faults = :faults", {"faults": faults})
    claim = context.store.leases.claim
    assert claim("construct", owner="w", full=["a", ""]).job.id == b
    assert claim("construct", owner="w", full=["a", ""]) is None
    assert claim("construct", owner="w", full=["a"]).job.id == operators


def test_heartbeats_change_a_narrow_row_and_no_index(context, add) -> None:
    add(1, 2)
    held = [claim(context), claim(context)]
    written = "SELECT string_agg(xmin::text, ' ' ORDER BY id) FROM jobs"
    before = scalar(context, written)
    assert len(context.store.leases.heartbeat(held)) == 2
    assert scalar(context, written) == before, "rows of jobs are wide"
    indexes = "SELECT string_agg(indexdef, ' ') FROM pg_indexes WHERE tablename = 'leases'"
    assert "expires_at" not in scalar(context, indexes)


def test_what_is_known_of_leases_goes_an_hour_after_their_end(context, add) -> None:
    add(1, 2, 3)
    ended, running, young = claim(context), claim(context), claim(context)
    finish(context, ended)
    finish(context, young)
    old = "UPDATE leases SET expires_at = now() - interval '2 hours' WHERE job_id <> :young"
    execute(context, old, {"young": young.job.id})
    context.store.leases.forget_ended()
    with context.store.database.transaction() as connection:
        left = set(connection.execute(text("SELECT job_id FROM leases")).scalars())
    assert left == {running.job.id, young.job.id}
    assert context.store.leases.recover() == [running.job.id]


def test_a_job_with_the_same_key_is_the_same_also_when_it_is_added_at_once(
    context, new_job
) -> None:
    given = [new_job(*range(100), model=model) for model in "mn"]

    def add(new: list[NewJobs]) -> int:
        with context.store.database.transaction() as connection:
            return context.store.jobs.add(new, connection=connection)

    with ThreadPoolExecutor(4) as threads:
        added = list(threads.map(add, [given, given[::-1], given[::-1], given]))
    assert sorted(added) == [0, 0, 0, 200]
    assert add([new_job(1), new_job(200)]) == 1


def test_jobs_are_claimed_in_the_order_in_which_they_were_given(context, new_job) -> None:
    seeds = (3, 1, 4, 15, 9, 2, 6, 5)
    given = [new_job(*seeds, model=model) for model in "mn"]
    with context.store.database.transaction() as connection:
        assert context.store.jobs.add([*given, given[0]], connection=connection) == 16
    claimed = [claim(context).job for _ in range(16)]
    assert [(job.model, job.seed) for job in claimed] == [(m, seed) for m in "mn" for seed in seeds]
    assert len({job.randomization_seed for job in claimed}) == 16


def test_a_cancelled_job_opens_when_wanted_and_an_errored_one_is_retried(
    context, new_job, add
) -> None:
    (job_id,) = add(1)
    with pytest.raises(UnknownIdError, match="unknown job 'job_x'"):
        context.store.jobs.get("job_x")
    with context.store.database.transaction() as connection:
        assert not context.store.jobs.retry(jobs.c.id == job_id, connection=connection)
        assert context.store.jobs.cancel([job_id], connection=connection) == [job_id]
        assert context.store.jobs.add([new_job(1)], connection=connection) == 1
    job = context.store.jobs.get(job_id)
    assert (job.state, job.outcome) == ("queued", None)
    context.store.leases.give_up(claim(context), "no key", reason="missing_key")
    assert context.store.jobs.get(job_id).outcome == "errored"
    with context.store.database.transaction() as connection:
        assert context.store.jobs.retry(jobs.c.id == job_id, connection=connection)
    assert context.store.jobs.get(job_id).state == "queued"


def test_a_reply_and_its_cost_are_written_together_and_once(context, add) -> None:
    (job_id,) = add(1)
    lease = claim(context)
    context.store.journal.append(lease, ENTRY)
    context.store.journal.append(lease, replace(ENTRY, sequence=1))
    with pytest.raises(IntegrityError):
        context.store.journal.append(lease, replace(ENTRY, sequence=1))
    job = context.store.jobs.get(job_id)
    assert (job.requests, job.input_tokens, job.cost_usd) == (2, 200, Decimal("0.500000"))
    read = context.store.journal.read(job_id)
    assert [each.sequence for each in read] == [0, 1]
    assert (read[0].reply, read[0].usage) == ({"text": "ü"}, USAGE)


def test_what_is_no_answer_is_paid_for_and_no_progress(context, add) -> None:
    (job_id,) = add(1)
    lease = claim(context)
    execute(context, "UPDATE jobs SET faults = 3")
    for sequence, finish_, faults in ((0, "garbage", 3), (1, "out_of_time", 3), (2, "stop", 0)):
        reply = {"text": "", "finish": finish_}
        context.store.journal.append(lease, replace(ENTRY, sequence=sequence, reply=reply))
        job = context.store.jobs.get(job_id)
        assert (job.faults, job.requests) == (faults, sequence + 1), finish_


def test_sums_that_a_provider_claims_never_overflow(context, add) -> None:
    (job_id,) = add(1)
    execute(context, "UPDATE jobs SET payer = 'sweep_x'")
    set_budget(context, "sweep_x", max_requests=99)
    lease = claim(context)
    most = Usage(requests=1, input_tokens=10**7, cost_usd=Decimal(60_000_000))
    for sequence in range(3):
        context.store.journal.append(lease, replace(ENTRY, sequence=sequence, usage=most))
    context.store.budgets.charge_lost(lease, most)
    assert context.store.jobs.get(job_id).cost_usd == MAX_USD
    budget = context.store.budgets.get("sweep_x")
    assert (budget.spent_cost_usd, budget.spent_requests) == (MAX_USD, 4)
