"""What was lost is found: messages that nobody has, and jobs whose workers died."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.jobs import execute, expire_leases
from support.statements import statements_of

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.process.reaper import Reaper
from buildarena_backend.queue.queues import MAX_WAITING, Queues
from buildarena_cli.local import free_port

LOST = "UPDATE jobs SET notified_at = now() - interval '1 min'"


@pytest.fixture
def submit(context, submissions):
    def make(samples: int) -> None:
        spec = SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=samples)
        submissions.submit_sweep(spec)
        assert context.queues.settle()

    return make


def reap(context, reaper: Reaper | None = None) -> int | None:
    """How many messages wait after a run."""
    (reaper or Reaper(context)).reap()
    assert context.queues.settle()
    return context.queues.waiting("construct")


def drain(context) -> None:
    with context.queues.app.connection_for_read() as connection:
        connection.default_channel.client.flushdb()


def test_lost_messages_are_sent_again_and_fresh_ones_not_doubled(context, submit) -> None:
    submit(5)
    assert reap(context) == 5
    drain(context)
    execute(context, LOST)
    assert reap(context) == 5


def test_a_long_queue_is_filled_little_by_little(context, submit) -> None:
    submit(900)
    reaper = Reaper(context)
    assert context.queues.waiting("construct") == MAX_WAITING == reap(context, reaper)
    drain(context)
    assert reap(context, reaper) == MAX_WAITING
    reap(context, reaper)  # its workers left some
    drain(context)
    assert reap(context, reaper) == MAX_WAITING, "what was not emptied is sent as many as ever"


@pytest.mark.ci
def test_a_queue_that_is_always_empty_is_sent_more_each_time(context, submit) -> None:
    submit(1700)
    reaper, sent = Reaper(context), []
    for _ in range(4):
        drain(context)
        sent.append(reap(context, reaper))
    assert sent == [200, 400, 800, 100]  # 200 were sent when they were submitted


def test_a_dead_workers_job_waits_again_and_a_run_with_nothing_to_do_costs_one_statement(
    context, submit
) -> None:
    reaper = Reaper(context)
    reaper.reap()  # the first one of some does what is seldom done
    with statements_of(context.store.database.engine) as statements:
        reaper.reap()
    assert len(statements) == 1
    # What comes later is found by any run.
    submit(1)
    lease = context.store.leases.claim("construct", owner="dead")
    assert context.store.waiting.is_quiet()
    expire_leases(context)
    drain(context)
    assert reap(context, reaper) == 1
    assert context.store.jobs.get(lease.job.id).state == "queued"


def test_one_reaper_works_at_a_time(context, submit) -> None:
    submit(1)
    drain(context)
    execute(context, LOST)
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({0x726561706572})")
        assert reap(context) == 0
    assert reap(context) == 1


def test_of_several_processes_one_reaps_in_each_period(context, monkeypatch) -> None:
    reaped: list[Reaper] = []

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
