import threading
import time
from datetime import timedelta

import pytest
from sqlalchemy import Connection, TextClause, event, text
from support.jobs import cancel, claim, execute, expire_leases, finish, journal_entry

from buildarena_pipeline.runtime.context import Context
from buildarena_store import Lease, Leases, StaleLeaseError, TurnResult


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


def test_the_hinted_job_is_taken_first_and_a_recovered_one_before_it(context, add) -> None:
    first, second, third = add(1, 2, 3)
    assert claim(context, hint=third).job.id == third
    lost = claim(context, hint=second)
    expire_leases(context)
    assert set(context.store.leases.recover()) == {second, third}
    assert claim(context, hint=first).job.id in {lost.job.id, third}


def test_a_hint_that_is_gone_still_brings_another_job(context, add) -> None:
    (only,) = add(1)
    assert claim(context, hint="job_gone").job.id == only
    assert context.store.leases.claim("construct", owner="w") is None
    assert context.store.leases.claim("simulate.mujoco", owner="w") is None


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
    finish(context, fresh, indicator=7.5)
    job = context.store.jobs.get(job_id)
    assert (job.outcome, job.indicator) == ("success", 7.5)


def test_a_scored_job_cannot_be_scored_again(context, add) -> None:
    add(1)
    lease = claim(context)
    finish(context, lease)
    for change in (
        lambda: finish(context, lease),
        lambda: context.store.leases.hand_back(lease),
    ):
        with pytest.raises(StaleLeaseError):
            change()
    assert context.store.jobs.get(lease.job.id).outcome == "success"
    assert context.store.leases.claim("construct", owner="w") is None


def test_turns_of_a_lost_lease_are_not_kept(context, add) -> None:
    (job_id,) = add(1)
    for lease in stale_and_fresh(context):
        turn = TurnResult(index=0, sequence=0, sub_structure=None, results=[])
        context.store.turns.append(lease, turn)
    told = "SELECT count(*) FROM events WHERE job_id = :id AND kind = 'turn'"
    with context.store.database.statement() as connection:
        assert connection.execute(text(told), {"id": job_id}).scalar_one() == 1


def test_heartbeats_keep_a_lease_and_say_of_lost_ones(context, add) -> None:
    add(1, 2)
    kept, lost = claim(context), claim(context)
    cancel(context, lost.job.id)
    assert context.store.leases.heartbeat([kept, lost]) == {kept.job.id: False}
    context.store.leases.duration = timedelta(seconds=0.05)
    context.store.leases.heartbeat([kept])
    time.sleep(0.1)
    assert context.store.leases.recover() == [kept.job.id]


def test_a_job_that_keeps_losing_its_workers_is_given_up(context, add) -> None:
    (job_id,) = add(1)
    leases = Leases(context.store.database, duration_s=1, max_faults=2)
    for _ in range(2):
        assert leases.claim("construct", owner="w") is not None
        expire_leases(context)
        leases.recover()
    job = context.store.jobs.get(job_id)
    assert (job.outcome, job.reason, job.success) == ("errored", "lost_worker", None)
    assert [attempt.result for attempt in context.store.jobs.attempts(job_id)] == ["lost", "lost"]


def test_a_fault_waits_before_the_next_attempt(context, add) -> None:
    add(1)
    lease = claim(context)
    assert context.store.leases.fault(lease, "outage", delay_s=30, reason="provider_outage")
    assert context.store.leases.claim("construct", owner="w") is None
    assert context.store.waiting.to_notify("construct", 10) == []


def test_handing_back_is_no_fault(context, add) -> None:
    (job_id,) = add(1)
    context.store.leases.hand_back(claim(context))
    job = context.store.jobs.get(job_id)
    assert (job.state, job.faults) == ("queued", 0)


def test_workers_are_notified_of_waiting_jobs_once(context, add) -> None:
    ids = add(1, 2, 3)
    assert set(context.store.waiting.to_notify("construct", 10)) == set(ids)
    assert context.store.waiting.to_notify("construct", 10) == []


def test_no_more_jobs_are_notified_than_asked_for_however_it_is_planned(context, add) -> None:
    add(*range(20))

    def take_nested_loops(connection: Connection) -> None:
        for way in ("hashagg", "hashjoin", "mergejoin", "sort", "material"):
            connection.exec_driver_sql(f"SET LOCAL enable_{way} = off")

    event.listen(context.store.database.engine, "begin", take_nested_loops)
    assert len(context.store.waiting.to_notify("construct", 3)) == 3


def test_a_cancelled_job_frees_its_worker(context, add) -> None:
    (job_id,) = add(1)
    lease = claim(context)
    cancel(context, job_id)
    with pytest.raises(StaleLeaseError):
        finish(context, lease)
    assert context.store.jobs.get(job_id).outcome == "cancelled"


def test_a_job_that_gets_on_is_not_given_up(context, add) -> None:
    (job_id,) = add(1)
    leases = Leases(context.store.database, duration_s=1, max_faults=2)
    for sequence in range(4):
        lease = leases.claim("construct", owner="w")
        assert lease is not None
        context.store.journal.append(lease, journal_entry(sequence))
        expire_leases(context)
        leases.recover()
    assert context.store.jobs.get(job_id).state == "queued"


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
        assert lease is not None
        last = lease.job.owner or ""
        taken.append(last)
    assert taken == ["", "a", "b", "c", "a", "b", "a", "a"]
    assert context.store.leases.claim("construct", owner="w", last="a") is None


def test_a_hint_does_not_jump_the_turn_of_another_owner(context, add) -> None:
    mine = owned(context, add, ["a", "a", "a", "b"])
    claim = context.store.leases.claim
    assert claim("construct", owner="w", hint=mine[2], last="b").job.id == mine[2]
    assert claim("construct", owner="w", hint=mine[1], last="a").job.id == mine[3]
    assert claim("construct", owner="w", hint=mine[1], last="a").job.id == mine[1]


@pytest.mark.parametrize("faults", [0, 1])
def test_jobs_of_full_owners_wait_whatever_names_them(context, add, faults) -> None:
    a, b, operators = owned(context, add, ["a", "b", None])
    execute(context, "UPDATE jobs SET faults = :faults", {"faults": faults})
    claim = context.store.leases.claim
    assert claim("construct", owner="w", hint=a, full=["a", ""]).job.id == b
    assert claim("construct", owner="w", hint=operators, full=["a", ""]) is None
    assert claim("construct", owner="w", full=["a"]).job.id == operators


def test_looking_at_leases_says_what_a_heartbeat_says_and_renews_nothing(context, add) -> None:
    add(1, 2)
    first, second = claim(context), claim(context)
    cancel(context, second.job.id)
    expires = text("SELECT expires_at FROM leases WHERE job_id = :id")
    with context.store.database.transaction() as connection:
        before = connection.execute(expires, {"id": first.job.id}).scalar_one()
    assert context.store.leases.held([first, second]) == {first.job.id: False}
    with context.store.database.transaction() as connection:
        assert connection.execute(expires, {"id": first.job.id}).scalar_one() == before
    assert context.store.leases.heartbeat([first, second]) == {first.job.id: False}
    assert context.store.leases.held([]) == {}


WRITTEN = text("SELECT pg_current_wal_insert_lsn() - '0/0'::pg_lsn")
CHANGED = text(
    """
    SELECT pg_stat_get_tuples_updated(oid), pg_stat_get_tuples_hot_updated(oid)
    FROM pg_class WHERE relname = :table
    """
)


@pytest.mark.parametrize("cost", [0, 7])
def test_heartbeats_change_a_narrow_row_and_no_index(context, add, cost) -> None:
    add(*range(40))
    held = [claim(context) for _ in range(40)]
    execute(context, "UPDATE jobs SET cost_usd = :cost", {"cost": cost})
    heartbeats, before, written = 0, changed(context), []
    while heartbeats < 1000 or changed(context)["leases"][0] - before["leases"][0] < heartbeats:
        begun = ask(context, WRITTEN)[0]
        assert len(context.store.leases.heartbeat(held)) == len(held)
        written.append((ask(context, WRITTEN)[0] - begun) / len(held))
        heartbeats += len(held)
        assert heartbeats < 10_000, "they are never counted"
    after = changed(context)
    # The claims, and the costs.
    assert after["jobs"][0] - before["jobs"][0] <= 2 * len(held)
    (all_before, hot_before), (all_after, hot_after) = before["leases"], after["leases"]
    assert all_after - all_before >= 1000
    # A snapshot of somebody else, such as autovacuum's, keeps old versions of rows for a moment:
    # two rounds of forty, for example. With an index on what changes no update would be one.
    assert hot_after - hot_before >= 0.8 * (all_after - all_before)
    # The log is the server's: tests beside this one write to it, too, but not all the time.
    assert min(written) < 900


def ask(context: Context, query: TextClause, **values: str) -> tuple[int, ...]:
    with context.store.database.transaction() as connection:
        connection.execute(text("SELECT pg_stat_force_next_flush()"))
        return tuple(map(int, connection.execute(query, values).one()))


def changed(context: Context) -> dict[str, tuple[int, ...]]:
    """Rows changed so far, and how many of them without a change of an index, by table."""
    return {table: ask(context, CHANGED, table=table) for table in ("jobs", "leases")}


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


def test_leases_of_the_release_before_end_by_their_own_column(context, add) -> None:
    add(1, 2)
    claim(context), claim(context)
    execute(context, "DELETE FROM leases")
    assert context.store.leases.recover() == []
    execute(context, "UPDATE jobs SET lease_expires_at = now() - interval '1 s' WHERE seed = 1")
    assert len(context.store.leases.recover()) == 1


def test_the_release_before_leaves_leases_of_this_one_alone(context, add) -> None:
    add(1)
    lease = claim(context)
    with context.store.database.transaction() as connection:
        query = text("SELECT lease_expires_at - now() > interval '1 hour' FROM jobs")
        assert connection.execute(query).scalar_one()
    expire_leases(context)
    assert context.store.leases.recover() == [lease.job.id]
