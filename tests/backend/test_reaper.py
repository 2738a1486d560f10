"""What was lost is found: messages that nobody has, and jobs whose workers died."""

import pytest
from support.jobs import expire_leases
from support.statements import statements_of

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.process.reaper import WOKEN, Reaper
from buildarena_backend.queue.queues import MAX_WAITING


@pytest.fixture
def submit(context, submissions):
    def make(samples: int) -> None:
        spec = SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=samples)
        submissions.submit_sweep(spec)
        context.queues.settle()

    return make


def reap(context, reaper: Reaper | None = None) -> int | None:
    """How many messages wait after a run."""
    (reaper or Reaper(context)).reap()
    context.queues.settle()
    return context.queues.waiting("construct")


def drain(context) -> None:
    with context.queues.app.connection_for_read() as connection:
        connection.default_channel.client.flushdb()


def test_messages_that_were_lost_are_sent_again_and_no_more_than_enough(context, submit) -> None:
    submit(5)
    assert context.queues.waiting("construct") == 5
    drain(context)
    assert reap(context) == 5
    submit(900)
    assert context.queues.waiting("construct") == MAX_WAITING == reap(context)
    drain(context)
    assert reap(context) == WOKEN


def test_a_dead_workers_job_waits_again_and_an_idle_run_is_one_statement(context, submit) -> None:
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
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({0x726561706572})")
        assert reap(context) == 0
    assert reap(context) == 1
