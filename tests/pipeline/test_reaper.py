from __future__ import annotations

from dataclasses import replace

import pytest
from support.statements import statements_of

from buildarena_cli.local import free_port
from buildarena_pipeline.broker.queues import MAX_WAITING, Queues
from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_pipeline.runtime.reaper import Reaper


def submit(context, submissions, samples: int) -> None:
    submissions.submit_sweep(
        SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=samples)
    )
    assert context.queues.settle()


def reap(context) -> None:
    Reaper(context).reap()
    assert context.queues.settle()


def drain(context) -> None:
    with context.queues.app.connection_for_read() as connection:
        connection.default_channel.client.flushdb()


def is_filled(context) -> bool:
    return context.queues.waiting("construct") == MAX_WAITING


def test_lost_messages_are_sent_again(context, submissions) -> None:
    submit(context, submissions, 5)
    drain(context)
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE jobs SET notified_at = now() - interval '1 min'")
    reap(context)
    assert context.queues.waiting("construct") == 5


def test_fresh_messages_are_not_doubled(context, submissions) -> None:
    submit(context, submissions, 5)
    reap(context)
    assert context.queues.waiting("construct") == 5


def test_a_long_queue_is_filled_little_by_little(context, submissions) -> None:
    submit(context, submissions, 450)
    assert is_filled(context)
    reap(context)
    assert is_filled(context)
    drain(context)
    reap(context)
    assert is_filled(context)


def test_a_dead_workers_job_waits_again(context, submissions) -> None:
    submit(context, submissions, 1)
    lease = context.store.leases.claim("construct", owner="dead")
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE leases SET expires_at = now() - interval '1 s'")
    drain(context)
    reap(context)
    assert context.store.jobs.get(lease.job.id).state == "queued"
    assert context.queues.waiting("construct") == 1


def test_a_run_with_nothing_to_do_costs_one_statement(context, submissions) -> None:
    reaper = Reaper(context)
    reaper.reap()  # the first one of some does what is seldom done
    with statements_of(context.store.database.engine) as statements:
        reaper.reap()
    assert len(statements) == 1
    # What comes later is found by any run.
    submit(context, submissions, 1)
    lease = context.store.leases.claim("construct", owner="dead")
    assert context.store.waiting.is_quiet()
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE leases SET expires_at = now() - interval '1 s'")
    drain(context)
    reaper.reap()
    assert context.store.jobs.get(lease.job.id).state == "queued"
    assert context.queues.settle()
    assert context.queues.waiting("construct") == 1
    drain(context)
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE jobs SET notified_at = NULL")
    reaper.reap()
    assert context.queues.settle()
    assert context.queues.waiting("construct") == 1


def test_one_reaper_works_at_a_time(context, submissions) -> None:
    submit(context, submissions, 1)
    drain(context)
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE jobs SET notified_at = NULL")
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({0x726561706572})")
        # The lock is held here; the update above is not visible to others until the end.
        reap(context)
        assert context.queues.waiting("construct") == 0


def test_of_several_processes_one_reaps_in_each_period(context, monkeypatch) -> None:
    reaped = []

    def note(reaper: Reaper) -> None:
        reaped.append(reaper)

    monkeypatch.setattr(Reaper, "reap", note)
    first, second = Reaper(context, period_s=30), Reaper(context, period_s=30)
    for reaper in (first, second, second, first):
        reaper._reap_safely()
    assert reaped == [first]
    # The broker only saves work: without one, each does it.
    away = Queues(f"redis://127.0.0.1:{free_port()}/0")
    alone = [Reaper(replace(context, queues=away), period_s=30) for _ in range(2)]
    for reaper in alone:
        reaper._reap_safely()
    assert reaped == [first, *alone]
    away.close()


@pytest.mark.ci
def test_a_queue_that_is_always_empty_is_sent_more_each_time(context, submissions) -> None:
    submit(context, submissions, 1700)
    reaper, sent = Reaper(context), []
    for _ in range(4):
        drain(context)
        reaper.reap()
        assert context.queues.settle()
        sent.append(context.queues.waiting("construct"))
    assert sent == [200, 400, 800, 100]  # 200 were sent when they were submitted


def test_a_queue_that_was_not_emptied_is_sent_as_many_as_ever(context, submissions) -> None:
    submit(context, submissions, 900)
    reaper = Reaper(context)
    drain(context)
    reaper.reap()
    assert context.queues.settle()
    reaper.reap()  # its workers left some
    assert context.queues.settle()
    drain(context)
    reaper.reap()
    assert context.queues.settle()
    assert context.queues.waiting("construct") == 200
