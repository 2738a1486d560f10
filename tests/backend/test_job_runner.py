"""Handlers of jobs: leases that live as long, what they hear, faults, and whose turn it is."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import pytest
from support.servers.stacks import wait_until

from buildarena_backend.accounts.budgets import BudgetLimits
from buildarena_backend.catalog.specs import JobSpec, SweepSpec
from buildarena_backend.errors import PermanentError, TransientError
from buildarena_backend.process import job_runner
from buildarena_backend.process.active_lease import ActiveLease, LeaseKeeper
from buildarena_backend.process.job_runner import SLICE_S, JobRunner, OwnerSlots
from buildarena_backend.results.results import JobScore

SCORE = JobScore(outcome="unsuccessful", success=0.0, indicator=1.0)
SPEC = JobSpec(task="support-1", model="builtin/idle")
SWEEP = SweepSpec(tasks=["support-1"], models=["paid/idle"], samples=3)


@pytest.fixture
def keeper(context) -> Iterator[LeaseKeeper]:
    found = LeaseKeeper(context.store.leases, lambda: None)
    found.start()
    yield found
    found.stop()


@pytest.fixture
def runner(context, keeper) -> Callable[[Callable[..., None]], JobRunner]:
    return lambda handler: JobRunner(context.store.leases, handler, keeper, "worker")


@pytest.fixture
def run(context, submissions, runner):
    """Submits a job and lets a handler work on it; returns the job afterwards."""

    def work(handler: Callable[..., None]):
        job, _ = submissions.submit_job(SPEC)
        runner(handler).process_next("construct")
        return context.store.jobs.get(job.id)

    return work


@pytest.fixture
def finish(context) -> Callable[[ActiveLease], None]:
    def end(active: ActiveLease) -> None:
        with context.store.database.transaction() as connection:
            context.store.results.finish(active.lease, SCORE, connection=connection)

    return end


@pytest.mark.ci
def test_a_lease_lives_as_long_as_its_handler(context, run, finish) -> None:
    def slow(active: ActiveLease) -> None:
        time.sleep(context.settings.lease_s * 1.5)
        context.store.leases.recover()
        assert not active.lost
        finish(active)

    assert run(slow).outcome == "unsuccessful"


def test_a_handler_hears_that_its_job_was_cancelled(context, run) -> None:
    def cancelled(active: ActiveLease) -> None:
        with context.store.database.transaction() as connection:
            context.store.jobs.cancel([active.lease.job.id], connection=connection)
        wait_until(lambda: active.lost, 5, "it is heard")

    assert run(cancelled).outcome == "cancelled"


def test_a_handler_hears_of_a_budget_given_meanwhile(context, submissions, runner, finish) -> None:
    sweep_id = submissions.submit_sweep(SWEEP.model_copy(update={"samples": 1})).sweep.id

    def paid_for_later(active: ActiveLease) -> None:
        assert not active.budgeted
        with context.store.database.transaction() as connection:
            context.store.budgets.set(sweep_id, BudgetLimits(max_requests=5), connection=connection)
        wait_until(lambda: active.budgeted, 20, "it is heard")
        finish(active)

    runner(paid_for_later).process_next("construct")
    assert context.store.sweeps.progress(sweep_id).outcomes == {"unsuccessful": 1}


@pytest.mark.parametrize(
    ("error", "ending"),
    [
        (TransientError("outage", reason="x", delay_s=9), ("queued", None, None)),
        (PermanentError("no key", reason="missing_key"), ("done", "errored", "missing_key")),
        (ZeroDivisionError("a bug"), ("queued", None, None)),
    ],
)
def test_faults_are_never_scored(run, error, ending) -> None:
    def fail(*_: object) -> None:
        raise error

    job = run(fail)
    assert (job.state, job.outcome, job.reason) == ending
    assert (job.success, job.faults) == (None, 1)


def test_what_is_held_at_shutdown_is_handed_back(context, submissions, keeper) -> None:
    job, _ = submissions.submit_job(SPEC)
    lease = context.store.leases.claim("construct", owner="w")
    with keeper.keeping(lease) as active:
        keeper.stop()
        assert active.lost
    assert context.store.jobs.get(job.id).state == "queued"
    assert [a.result for a in context.store.jobs.attempts(job.id)] == ["handed_back"]


def test_a_stop_waits_for_a_claim_under_way(context, submissions, runner, monkeypatch) -> None:
    submissions.submit_job(SPEC)
    claiming, go_on, claim = Event(), Event(), context.store.leases.claim

    def slow_claim(queue, **options):
        claiming.set()
        go_on.wait(10)
        return claim(queue, **options)

    monkeypatch.setattr(context.store.leases, "claim", slow_claim)
    works = runner(lambda _: None)
    with ThreadPoolExecutor(2) as threads:
        claimed = threads.submit(works.process_next, "construct")
        assert claiming.wait(10)
        stopped = threads.submit(works.stop)
        with pytest.raises(TimeoutError):
            stopped.result(timeout=0.2)
        go_on.set()
        stopped.result(timeout=10)
        assert claimed.result(timeout=10)
    assert not works.process_next("construct")


def test_one_message_does_short_jobs_and_no_more(
    context, submissions, runner, finish, monkeypatch
) -> None:
    def slow(active: ActiveLease) -> None:
        time.sleep(SLICE_S)
        finish(active)

    sweep = submissions.submit_sweep(SWEEP).sweep.id
    runner(slow).process_some("construct")
    assert context.store.sweeps.progress(sweep).done == 1
    monkeypatch.setattr(job_runner, "SLICE_S", 60.0)  # jobs are short, however busy the machine
    runner(finish).process_some("construct")
    assert context.store.sweeps.progress(sweep).done == 3


def greedy(slots: OwnerSlots, owner: str) -> int:
    """How many further slots an owner gets that takes all it can."""
    taken = 0
    while slots.free and owner not in slots.full():
        slots.take(owner)
        taken += 1
    return taken


def test_one_owner_alone_gets_what_is_configured_and_others_find_room() -> None:
    for configured in (1, 2, 3, 5, 8, 32, 40, 200):
        slots = OwnerSlots(configured)
        assert greedy(slots, "a") == configured
        assert greedy(slots, "b") >= 1, configured
    slots = OwnerSlots(40)
    assert [greedy(slots, owner) for owner in "abcd"] == [40, 8, 1, 1]
    assert slots.free == 0
    for _ in range(20):
        slots.release("a")
    assert greedy(slots, "d") > 10
    slots = OwnerSlots(1)
    slots.take("a")
    assert slots.full() == ["a"]
    slots.release("a")
    assert slots.full() == []
