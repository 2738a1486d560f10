from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from buildarena_pipeline.catalog.specs import JobSpec, SweepSpec
from buildarena_pipeline.errors import PermanentError, TransientError
from buildarena_pipeline.runtime import job_runner
from buildarena_pipeline.runtime.active_lease import ActiveLease, LeaseKeeper
from buildarena_pipeline.runtime.job_runner import SLICE_S, JobRunner
from buildarena_store import BudgetLimits, JobScore

SCORE = JobScore(outcome="unsuccessful", success=False, indicator=1.0)


@pytest.fixture
def run(context, submissions):
    """Submits a job and lets a handler work on it; returns the job afterwards."""

    def work(handler: Callable[..., None]):
        job, _ = submissions.submit_job(JobSpec(task="support-1", model="builtin/idle"))
        keeper = LeaseKeeper(context.store.leases, lambda: None)
        keeper.start()
        JobRunner(context.store.leases, handler, keeper, "worker").process_next("construct", job.id)
        keeper.stop()
        return context.store.jobs.get(job.id)

    return work


def finisher(context) -> Callable[..., None]:
    def finish(active: ActiveLease) -> None:
        with context.store.database.transaction() as connection:
            context.store.results.finish(active.lease, SCORE, connection=connection)

    return finish


def test_a_handler_ends_the_job(context, run) -> None:
    assert run(finisher(context)).outcome == "unsuccessful"


@pytest.mark.ci
def test_a_lease_lives_as_long_as_its_handler(context, run) -> None:
    def slow(active: ActiveLease) -> None:
        time.sleep(context.settings.lease_s * 1.5)
        context.store.leases.recover()
        assert not active.lost
        finisher(context)(active)

    assert run(slow).outcome == "unsuccessful"


def test_a_handler_hears_that_its_job_was_cancelled(context, run) -> None:
    heard: list[bool] = []

    def cancelled(active: ActiveLease) -> None:
        with context.store.database.transaction() as connection:
            context.store.jobs.cancel([active.lease.job.id], connection=connection)
        deadline = time.monotonic() + 5
        while not active.lost and time.monotonic() < deadline:
            time.sleep(0.05)
        heard.append(active.lost)

    assert run(cancelled).outcome == "cancelled"
    assert heard == [True]


def test_a_handler_hears_of_a_budget_that_was_given_meanwhile(context, submissions) -> None:
    spec = SweepSpec(tasks=["support-1"], models=["builtin/idle"], seeds=[0])
    sweep_id = submissions.submit_sweep(spec).sweep.id
    heard: list[bool] = []

    def paid_for_later(active: ActiveLease) -> None:
        heard.append(active.budgeted)
        with context.store.database.transaction() as connection:
            context.store.budgets.set(sweep_id, BudgetLimits(max_requests=5), connection=connection)
        deadline = time.monotonic() + 20
        while not active.budgeted and time.monotonic() < deadline:
            time.sleep(0.05)
        heard.append(active.budgeted)
        finisher(context)(active)

    keeper = LeaseKeeper(context.store.leases, lambda: None)
    keeper.start()
    JobRunner(context.store.leases, paid_for_later, keeper, "worker").process_next(
        "construct", "any"
    )
    keeper.stop()
    assert heard == [False, True]


@pytest.mark.parametrize(
    ("error", "state", "outcome", "reason"),
    [
        (TransientError("outage", reason="provider_outage", delay_s=9), "queued", None, None),
        (PermanentError("no key", reason="missing_key"), "done", "errored", "missing_key"),
        (ZeroDivisionError("a bug"), "queued", None, None),
    ],
)
def test_faults_are_never_scored(run, error, state, outcome, reason) -> None:
    def fail(*_: object) -> None:
        raise error

    job = run(fail)
    assert (job.state, job.outcome, job.reason) == (state, outcome, reason)
    assert job.success is None
    assert job.faults == 1


def test_what_is_held_at_shutdown_is_handed_back(context, submissions) -> None:
    job, _ = submissions.submit_job(JobSpec(task="support-1", model="builtin/idle"))
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    keeper.start()
    lease = context.store.leases.claim("construct", owner="w")
    with keeper.keeping(lease) as active:
        keeper.stop()
        assert active.lost
    assert context.store.jobs.get(job.id).state == "queued"
    assert [a.result for a in context.store.jobs.attempts(job.id)] == ["handed_back"]


def runner_of(context, handler: Callable[..., None]) -> JobRunner:
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    return JobRunner(context.store.leases, handler, keeper, "worker")


def test_one_message_has_several_short_jobs_done(context, submissions, monkeypatch) -> None:
    monkeypatch.setattr(job_runner, "SLICE_S", 60.0)  # jobs are short, however busy the machine
    spec = SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=3)
    sweep = submissions.submit_sweep(spec).sweep
    runner_of(context, finisher(context)).process_some("construct", "")
    assert context.store.sweeps.progress(sweep.id).done == 3


def test_a_message_has_no_further_job_done_after_a_long_one(context, submissions) -> None:
    spec = SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=3)
    sweep = submissions.submit_sweep(spec).sweep

    def slow(active: ActiveLease) -> None:
        time.sleep(SLICE_S)
        finisher(context)(active)

    runner_of(context, slow).process_some("construct", "")
    assert context.store.sweeps.progress(sweep.id).done == 1
