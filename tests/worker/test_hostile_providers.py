"""A provider can't hold the house: whatever it does or leaves, others work on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from decimal import Decimal

import pytest
from sqlalchemy import text
from support.providers.stand_in import ProviderStandIn
from support.servers.construct_threads import crew, models_file
from support.servers.stacks import wait_until
from support.stages import work

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import BudgetLimits
from buildarena_worker.wiring import verifier

SOON_S = 3.0
"""A cancelled job is noticed within a second; the rest is for a busy machine."""
USAGE = {"prompt_tokens": 100, "completion_tokens": 50}


def stuck(how: str) -> ProviderStandIn:
    return ProviderStandIn(fault=lambda _: how)


def cancel(context, job_id: str) -> None:
    with context.store.database.transaction() as connection:
        context.store.jobs.cancel([job_id], connection=connection)


def lose(context, job_id: str) -> None:
    """What happens when another worker took the job over."""
    with context.store.database.transaction() as connection:
        connection.execute(
            text("UPDATE jobs SET lease_token = lease_token + 1 WHERE id = :id"), {"id": job_id}
        )


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("how", ["hang", "drip"])
@pytest.mark.parametrize("end", [cancel, lose])
def test_a_request_ends_with_its_lease(context, tmp_path, how, end) -> None:
    with stuck(how) as bad, crew(context, tmp_path, bad=bad) as workers:
        job_id = workers.submit("bad")
        wait_until(lambda: bad.counts.requests, 10, "the request is sent")
        end(context, job_id)
        wait_until(lambda: bad.left, SOON_S, "the connection is closed")
        wait_until(lambda: workers.slots.free == workers.slots.total, SOON_S, "the slot is free")
    assert context.store.journal.read(job_id) == []


@pytest.mark.ci
def test_a_wait_between_tries_ends_with_the_lease(context, tmp_path) -> None:
    with (
        ProviderStandIn(fault=lambda _: "500") as bad,
        crew(context, tmp_path, bad=bad) as workers,
    ):
        job_id = workers.submit("bad")
        # The waits double: after four tries the next is 4 s at least.
        wait_until(lambda: bad.counts.requests >= 4, 20, "tries")
        cancel(context, job_id)
        wait_until(lambda: workers.slots.free == workers.slots.total, SOON_S, "the slot is free")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("how", ["hang", "drip", "500", "garbage"])
def test_a_job_s_seconds_end_its_request_and_are_verified(context, tmp_path, how) -> None:
    with stuck(how) as bad, crew(context, tmp_path, bad=bad) as workers:
        job = workers.ended(workers.submit("bad", limits={"max_seconds": 1.5}), 10)
    assert (job.outcome, job.reason) == ("limit", "max_seconds"), job.detail
    entries = workers.requests(job.id)
    assert {"garbage", "out_of_time"} >= {entry["finish"] for entry in entries}
    assert how == "garbage" or len(entries) == 1
    seconds = sum(entry["latency_s"] for entry in entries)
    assert 1.5 <= seconds < 4
    assert job.requests == len(entries)
    # What was sent and broken off costs what was sent.
    assert (job.input_tokens > 100) == (how in {"hang", "drip"})
    assert (job.cost_usd > 0) == (how in {"hang", "drip"})
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


@pytest.mark.ci
def test_nobody_has_free_requests_by_cancelling(context, tmp_path) -> None:
    limits = BudgetLimits(max_cost_usd=Decimal(100))
    with context.store.database.transaction() as connection:
        context.store.budgets.set("key_a", limits, connection=connection)
    with stuck("hang") as bad, crew(context, tmp_path, bad=bad) as workers:
        job_id = workers.submit("bad", owner="key_a")
        wait_until(lambda: bad.counts.requests, 10, "the request is sent")
        cancel(context, job_id)
        wait_until(lambda: workers.slots.free == workers.slots.total, SOON_S, "the slot is free")
    spent = context.store.budgets.get("key_a")
    assert spent is not None
    assert spent.spent_requests == 1
    assert spent.spent_tokens > 100
    assert spent.spent_cost_usd > 0
    # A provider that can't be reached got nothing.
    with (
        ProviderStandIn(fault=lambda _: "500") as bad,
        crew(context, tmp_path, bad=bad) as workers,
    ):
        job_id = workers.submit("bad", owner="key_a", seed=1)
        wait_until(lambda: bad.counts.requests >= 2, 20, "tries")
        cancel(context, job_id)
        wait_until(lambda: workers.slots.free == workers.slots.total, SOON_S, "the slot is free")
    assert context.store.budgets.get("key_a") == spent


@pytest.mark.ci
def test_shutdown_ends_open_requests(context, settings, tmp_path) -> None:
    with stuck("hang") as bad:
        file = models_file(tmp_path, {"bad": bad})
        job, _ = Submissions(context, load_registry(file)).submit_job(
            JobSpec(task="lift-1", model="bad/expert", simulator="mujoco")
        )
        environment = {
            **os.environ,
            "BUILDARENA_DATABASE_URL": settings.required_database_url(),
            "BUILDARENA_BROKER_URL": settings.required_broker_url(),
            "BUILDARENA_DATA": str(settings.data),
            "BUILDARENA_MODELS_FILE": str(file),
            "BUILDARENA_STOP_GRACE_S": "3",
        }
        process = subprocess.Popen([sys.executable, "-m", "buildarena_worker"], env=environment)
        try:
            wait_until(lambda: bad.counts.requests, 20, "the request is sent")
            process.send_signal(signal.SIGTERM)
            process.wait(timeout=8)
        finally:
            process.kill()
            process.wait()
        wait_until(lambda: bad.left, 1, "the connection is closed")
    job = context.store.jobs.get(job.id)
    assert (job.state, job.faults) == ("queued", 0)
    assert [a.result for a in context.store.jobs.attempts(job.id)] == ["handed_back"]


@pytest.mark.ci
def test_forty_hanging_sessions_leave_room_for_another_owner(context, tmp_path) -> None:
    with (
        stuck("hang") as bad,
        ProviderStandIn() as good,
        crew(context, tmp_path, slots=40, bad=bad, good=good) as workers,
    ):
        for seed in range(60):
            workers.submit("bad", seed=seed, owner="key_a")
        wait_until(lambda: bad.counts.requests == 40, 20, "one owner has what is configured")
        started = time.monotonic()
        job_id = workers.submit("good", seed=0, owner="key_b")
        wait_until(lambda: good.counts.requests, 2, "the other owner's session has begun")
        assert time.monotonic() - started < 2
        wait_until(lambda: workers.job(job_id).stage == "simulate", 20, "and built its machine")
        assert bad.counts.requests == 40


def chat(**changes: object) -> bytes:
    """A chat completion, with some of it replaced."""
    answer = {
        "id": "r",
        "model": "m",
        "choices": [{"message": {"content": "x"}, "finish_reason": "stop"}],
        "usage": USAGE,
    }
    return json.dumps({**answer, **changes}).encode()


GARBAGE = {
    "no json": b"<html>welcome</html>",
    "nothing": b"",
    "a list": b"[]",
    "other json": b'{"nothing": "here"}',
    "usage alone": json.dumps({"usage": USAGE}).encode(),
    "deep": b"[" * 100_000,
    "deep in usage": b'{"model": "m", "id": "r", "choices": 1, "usage": ' + b'{"a":' * 100_000,
    "nine megabytes": b"[" + b" " * (9 * 1024 * 1024) + b"]",
    "not utf-8": b"\xff\xfe\x00",
    "choices of text": chat(choices="many"),
    "no choices": chat(choices=[]),
    "text a number": chat(choices=[{"message": {"content": 5}}]),
    "name a number": chat(
        choices=[
            {
                "message": {
                    "tool_calls": [
                        {"id": "c", "type": "function", "function": {"name": 7, "arguments": "{}"}}
                    ]
                }
            }
        ]
    ),
}
CHARGED = {"usage alone", "choices of text", "no choices", "text a number", "name a number"}


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("name", GARBAGE)
def test_garbage_is_counted_charged_and_bounded(context, tmp_path, name) -> None:
    with (
        ProviderStandIn(fault=lambda _: GARBAGE[name]) as bad,
        crew(context, tmp_path, bad=bad) as workers,
    ):
        job = workers.ended(workers.submit("bad", limits={"max_requests": 2}))
        assert bad.counts.requests == 2
    assert (job.outcome, job.reason, job.requests) == ("limit", "max_requests", 2)
    assert job.input_tokens == (200 if name in CHARGED else 0)
    assert job.cost_usd == (Decimal("0.0012") if name in CHARGED else 0)
    assert [entry["finish"] for entry in workers.requests(job.id)] == ["garbage"] * 2
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


def test_garbage_forever_ends_as_errored(context, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("buildarena_worker.session.host.OUTAGE_DELAY_S", 0.0)
    monkeypatch.setattr("buildarena_worker.session.host.FIRST_WAIT_S", 0.001)
    context.store.leases.max_faults = 3
    with stuck("garbage") as bad, crew(context, tmp_path, bad=bad) as workers:
        job = workers.ended(workers.submit("bad"))
        assert bad.counts.requests == 18
    assert (job.outcome, job.reason, job.requests) == ("errored", "provider_outage", 18)


@pytest.mark.ci
def test_after_garbage_the_session_goes_on_and_is_verified(context, tmp_path) -> None:
    bad_ones = {3, 4, 9}
    with (
        ProviderStandIn(fault=lambda n: GARBAGE["no choices"] if n in bad_ones else None) as bad,
        crew(context, tmp_path, bad=bad) as workers,
    ):
        job_id = workers.submit("bad")
        wait_until(lambda: workers.job(job_id).stage == "simulate", 30, "the machine is built")
    work(context)
    job = context.store.jobs.get(job_id)
    assert job.outcome == "success", job.detail
    assert job.requests == bad.counts.requests
    finishes = [entry["finish"] for entry in workers.requests(job_id)]
    assert [n for n, finish in enumerate(finishes) if finish == "garbage"] == sorted(bad_ones)
    report = verifier(context).verify(job_id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


@pytest.mark.parametrize("status", ["301", "302", "303", "307", "308"])
def test_redirects_are_refused_and_the_key_goes_nowhere(context, tmp_path, status) -> None:
    with (
        ProviderStandIn() as thief,
        ProviderStandIn(fault=lambda _: status, elsewhere=f"{thief.url}/v1/x") as bad,
        crew(context, tmp_path, bad=bad) as workers,
    ):
        job = workers.ended(workers.submit("bad"))
        assert (thief.counts.requests, bad.counts.requests) == (0, 1)
    assert (job.outcome, job.reason) == ("errored", "request_refused")
    assert f"HTTP {status}: the provider redirects to {thief.url}/v1/x" in job.detail
