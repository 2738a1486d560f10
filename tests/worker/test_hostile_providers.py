"""A provider and its replies can hold nobody up, and reach nothing."""

import itertools
import json
import re
import time
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest
from sqlalchemy import text
from support.providers.stand_in import ProviderStandIn
from support.servers.construct_threads import crew
from support.servers.stacks import wait_until
from support.stages import assert_verified, work

from buildarena_backend.accounts.budgets import BudgetLimits
from buildarena_backend.catalog.specs import JobSpec
from buildarena_worker import builtin
from buildarena_worker.builtin import expert
from buildarena_worker.session.messages import Completion, Request

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
    bad = ProviderStandIn(fault=lambda _: "500")
    with bad, crew(context, tmp_path, bad=bad) as workers:
        job_id = workers.submit("bad")
        # The waits double: after four tries the next is 4 s at least.
        wait_until(lambda: bad.counts.requests >= 4, 20, "tries")
        cancel(context, job_id)
        wait_until(lambda: workers.slots.free == workers.slots.total, SOON_S, "the slot is free")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("how", ["hang", "drip", "500", "garbage"])
def test_a_job_s_seconds_end_its_request_and_are_verified(context, tmp_path, how) -> None:
    with stuck(how) as bad, crew(context, tmp_path, bad=bad) as workers:
        job = workers.ended(workers.submit("bad", limits={"max_duration_s": 1.5}), 10)
    assert (job.outcome, job.reason) == ("limit", "max_duration_s"), job.detail
    entries = workers.requests(job.id)
    assert {"garbage", "out_of_time"} >= {entry["finish"] for entry in entries}
    assert how == "garbage" or len(entries) == 1
    seconds = sum(entry["latency_s"] for entry in entries)
    assert 1.5 <= seconds < 4
    assert job.requests == len(entries)
    # What was sent and broken off costs what was sent.
    assert (job.input_tokens > 100) == (how in {"hang", "drip"})
    assert (job.cost_usd > 0) == (how in {"hang", "drip"})
    assert_verified(context, job.id)


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
    bad = ProviderStandIn(fault=lambda _: "500")
    with bad, crew(context, tmp_path, bad=bad) as workers:
        job_id = workers.submit("bad", owner="key_a", seed=1)
        wait_until(lambda: bad.counts.requests >= 2, 20, "tries")
        cancel(context, job_id)
        wait_until(lambda: workers.slots.free == workers.slots.total, SOON_S, "the slot is free")
    assert context.store.budgets.get("key_a") == spent


@pytest.mark.ci
def test_forty_hanging_sessions_leave_room_for_another_owner(context, tmp_path) -> None:
    good, slots = ProviderStandIn(), 40
    with stuck("hang") as bad, good, crew(context, tmp_path, slots, bad=bad, good=good) as workers:
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
    said = {"message": {"content": "x"}, "finish_reason": "stop"}
    answer = {"id": "r", "model": "m", "choices": [said], "usage": USAGE}
    return json.dumps({**answer, **changes}).encode()


def test_garbage_forever_ends_as_errored(context, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("buildarena_worker.session.host.OUTAGE_DELAY_S", 0.0)
    monkeypatch.setattr("buildarena_worker.session.requester.FIRST_WAIT_S", 0.001)
    context.store.leases.max_faults = 3
    with stuck("garbage") as bad, crew(context, tmp_path, bad=bad) as workers:
        job = workers.ended(workers.submit("bad"))
        assert bad.counts.requests == 18
    assert (job.outcome, job.reason, job.requests) == ("errored", "provider_outage", 18)


@pytest.mark.ci
def test_after_garbage_the_session_goes_on_and_is_verified(context, tmp_path) -> None:
    bad_ones = {3, 4, 9}
    bad = ProviderStandIn(fault=lambda n: chat(choices=[]) if n in bad_ones else None)
    with bad, crew(context, tmp_path, bad=bad) as workers:
        job_id = workers.submit("bad")
        wait_until(lambda: workers.job(job_id).stage == "simulate", 30, "the machine is built")
    work(context)
    job = context.store.jobs.get(job_id)
    assert job.outcome == "success", job.detail
    assert job.requests == bad.counts.requests
    finishes = [entry["finish"] for entry in workers.requests(job_id)]
    assert [n for n, finish in enumerate(finishes) if finish == "garbage"] == sorted(bad_ones)
    assert_verified(context, job_id)


LURES = (
    "../../../../etc/passwd",
    "/etc/shadow",
    "file:///etc/passwd",
    "http://127.0.0.1:9/steal?x=1",
    "$(touch /tmp/buildarena-pwned)",
    "`id`; rm -rf ~",
    "__import__('os').system('id')",
    "{{7*7}} ${7*7} %(x)s {0.__class__}",
    "!!python/object/apply:os.system ['id']",
    "'; DROP TABLE jobs; --",
    "<script src=http://127.0.0.1:9/x.js></script>",
    "\u0000\ud800\x1b[2J",
    "[bold]rich[/bold] [link=file:///etc/passwd]x[/link]",
)


def spiced_expert() -> object:
    """The expert, whose every text and note carries a lure."""
    lures = itertools.cycle(LURES)

    def reply(request: Request) -> Completion:
        said = expert.reply(request)
        calls = tuple(
            replace(call, arguments={**call.arguments, "note": next(lures)})
            if call.name in {"start", "attach_block_to", "connect_blocks"}
            else call
            for call in said.calls
        )
        # The controller's answer is a program: only what stands around it may be spiced. Guidance
        # begins with a step's number.
        parts = (said.text, next(lures)) if said.text[:1].isdigit() else (next(lures), said.text)
        return replace(said, text="\n".join(parts), calls=calls)

    return reply


def test_lures_in_a_good_machine_stay_plain_text(
    context, submissions, monkeypatch, tmp_path
) -> None:
    monkeypatch.setitem(builtin.MODELS, "expert", spiced_expert())
    spec = JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco")
    job, _ = submissions.submit_job(spec)
    work(context)
    job = context.store.jobs.get(job.id)
    assert job.outcome == "success", job.detail
    transcript = context.artifacts.get(context.store.jobs.artifacts(job.id)["transcript"]).decode()
    assert "etc/passwd" in transcript
    written = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    assert all(re.fullmatch(r"data/artifacts/..\/[0-9a-f]{64}", str(path)) for path in written)
    assert not Path("/tmp/buildarena-pwned").exists()
