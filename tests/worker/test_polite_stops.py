"""A worker that is asked to stop throws no reply away and loses no attempt."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from sqlalchemy import event
from support.providers.stand_in import ProviderStandIn
from support.servers.construct_threads import Crew, crew, models_file
from support.servers.stacks import wait_until

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import BudgetLimits

SESSIONS = 16


@contextmanager
def slow_database(context, seconds: float) -> Iterator[None]:
    """Each statement of this process takes so much longer."""
    engine = context.store.database.engine

    def wait(*_: object) -> None:
        time.sleep(seconds)

    event.listen(engine, "before_cursor_execute", wait)
    try:
        yield
    finally:
        event.remove(engine, "before_cursor_execute", wait)


def stop(workers: Crew, *, finishing_s: float) -> None:
    """What the process does when it is asked to stop."""
    workers.runner.stop()
    workers.keeper.drain(finishing_s)
    workers.keeper.stop()


def answered(context, job_ids: Sequence[str]) -> int:
    return sum(len(context.store.journal.read(job_id)) for job_id in job_ids)


def attempts(context, job_ids: Sequence[str]) -> list[str | None]:
    return [a.result for job_id in job_ids for a in context.store.jobs.attempts(job_id)]


@pytest.mark.parametrize(
    ("latency_s", "statement_s"),
    [(1.5, 0.1), pytest.param(12.0, 1.0, marks=pytest.mark.nightly)],
)
def test_open_requests_are_answered_and_journalled(
    context, tmp_path, latency_s, statement_s
) -> None:
    with ProviderStandIn(latency_s=latency_s) as model:
        with crew(context, tmp_path, slots=SESSIONS, good=model) as workers:
            jobs = [workers.submit("good", seed=seed) for seed in range(SESSIONS)]
            wait_until(lambda: model.counts.requests >= SESSIONS, 60, "all have asked")
            with slow_database(context, statement_s):
                stop(workers, finishing_s=40)
                sent = model.counts.requests
                assert answered(context, jobs) == sent
        assert attempts(context, jobs) == ["handed_back"] * SESSIONS
        assert {context.store.jobs.get(job).state for job in jobs} == {"queued"}
        model.latency_s = 0.0
        with crew(context, tmp_path, slots=SESSIONS, good=model) as workers:
            wait_until(
                lambda: {workers.job(job).stage for job in jobs} == {"simulate"}, 60, "all go on"
            )
        assert model.counts.requests == answered(context, jobs)
        assert attempts(context, jobs) == ["handed_back", "done"] * SESSIONS


@pytest.mark.ci
def test_a_request_that_takes_too_long_is_given_up_and_counted(context, tmp_path) -> None:
    with context.store.database.transaction() as connection:
        context.store.budgets.set("key_a", BudgetLimits(max_requests=9), connection=connection)
    with (
        ProviderStandIn(fault=lambda _: "hang") as model,
        crew(context, tmp_path, good=model) as workers,
    ):
        job = workers.submit("good", owner="key_a")
        wait_until(lambda: model.counts.requests, 20, "it has asked")
        started = time.monotonic()
        stop(workers, finishing_s=0.5)
        assert 0.5 <= time.monotonic() - started < 5
        wait_until(lambda: workers.slots.free == workers.slots.total, 5, "the slot is free")
    assert attempts(context, [job]) == ["handed_back"]
    spent = context.store.budgets.get("key_a")
    assert spent is not None
    assert spent.lost_requests == 1


@pytest.mark.ci
def test_nothing_is_sent_again_after_the_stop(context, tmp_path) -> None:
    with (
        ProviderStandIn(fault=lambda _: "500") as model,
        crew(context, tmp_path, good=model) as workers,
    ):
        job = workers.submit("good")
        # The waits double: after four tries the next is 4 s at least.
        wait_until(lambda: model.counts.requests >= 4, 20, "tries")
        started, sent = time.monotonic(), model.counts.requests
        stop(workers, finishing_s=20)
        assert time.monotonic() - started < 3
        assert model.counts.requests <= sent + 1
    assert attempts(context, [job]) == ["handed_back"]
    assert context.store.jobs.get(job).faults == 0


@pytest.mark.ci
def test_a_worker_that_is_asked_to_stop_waits_for_its_reply(context, settings, tmp_path) -> None:
    with ProviderStandIn(latency_s=1.5) as model:
        file = models_file(tmp_path, {"good": model})
        job, _ = Submissions(context, load_registry(file)).submit_job(
            JobSpec(task="lift-1", model="good/expert", simulator="mujoco")
        )
        environment = {
            **os.environ,
            "BUILDARENA_DATABASE_URL": settings.required_database_url(),
            "BUILDARENA_BROKER_URL": settings.required_broker_url(),
            "BUILDARENA_DATA": str(settings.data),
            "BUILDARENA_MODELS_FILE": str(file),
        }
        process = subprocess.Popen([sys.executable, "-m", "buildarena_worker"], env=environment)
        try:
            wait_until(lambda: model.counts.requests, 30, "the request is sent")
            process.send_signal(signal.SIGTERM)
            assert process.wait(timeout=20) == 0
        finally:
            process.kill()
            process.wait()
    assert answered(context, [job.id]) == model.counts.requests
    assert attempts(context, [job.id]) == ["handed_back"]
    assert context.store.jobs.get(job.id).state == "queued"
