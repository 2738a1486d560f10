"""Metrics, the request log and health: what an operator sees, whatever the stores do."""

import asyncio
import json
import platform
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

import httpx
import pytest
import structlog
from prometheus_client.parser import text_string_to_metric_families
from pydantic import SecretStr
from support.clients.tenants import ADMIN, WITH_KEYS
from support.jobs import claim, execute, journal_entry, report_worker
from support.servers.flaky_proxy import FlakyProxy, flaky_proxy
from support.servers.live_api import api_client, live_api
from support.servers.stacks import wait_until

from buildarena_api.http import log as request_log
from buildarena_api.http import parts
from buildarena_api.http.parts import PATIENCE_S, Part
from buildarena_api.routes.health import FEW_LOST
from buildarena_backend import __version__
from buildarena_backend.journal.journal import Usage
from buildarena_backend.telemetry.logs import set_up_logs

METRICS = "a-secret-for-metrics-alone-of-some-length"
PARTS = {"database": "database_up", "broker": "broker_up", "artifacts": "artifact_store_up"}


def samples(client, **headers: str) -> dict[str, list[tuple[dict[str, str], float]]]:
    found: dict[str, list[tuple[dict[str, str], float]]] = {}
    for family in text_string_to_metric_families(client.get("/v1/metrics", headers=headers).text):
        for sample in family.samples:
            name = sample.name.removeprefix("buildarena_")
            found.setdefault(name, []).append((sample.labels, sample.value))
    return found


def only(found: dict[str, list[tuple[dict[str, str], float]]], name: str) -> float:
    ((_, value),) = found[name]
    return value


def checks(client) -> dict[str, dict]:
    return {check["name"]: check for check in client.get("/v1/health").json()["checks"]}


def test_metrics_say_what_the_jobs_say(api, context, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": [0, 1, 2, 3]})
    first = claim(context)
    usage = Usage(requests=1, input_tokens=70, output_tokens=7)
    context.store.journal.append(first, journal_entry(usage=usage))
    context.store.leases.give_up(first, "no key", reason="missing_key")
    claim(context)
    for _ in range(3):
        api.get("/v1/jobs/job_x")
    # Another process has read nothing yet.
    with api_client(context) as other:
        assert ({"queue": "construct"}, 1.0) in samples(other)["queue_running"]
    found = samples(api)
    model = {"model": "builtin/idle"}
    held = {"stage": "construct", "result": "fault"}
    asked = {"route": "/v1/jobs/{job_id}", "method": "GET", "status": "404"}
    program = {"version": __version__, "python": platform.python_version()}
    for name, labels, value in (
        ("jobs", {"state": "queued", "stage": "construct", "outcome": ""}, 2),
        ("errored_jobs", {"reason": "missing_key"}, 1),
        ("queue_jobs", {"queue": "construct"}, 2),
        ("model_requests_total", model, 1),
        ("model_tokens_total", {**model, "direction": "input"}, 70),
        ("sweeps", {"state": "active"}, 1),
        ("stage_seconds_count", held, 1),
        ("stage_seconds_bucket", {**held, "le": "+Inf"}, 1),
        ("http_request_seconds_count", asked, 3),
        ("http_responses_total", {"status": "404"}, 3),
        ("build_info", program, 1),
    ):
        assert (labels, float(value)) in found[name], name
    assert found["queue_oldest_seconds"][0][1] >= 0
    api.post(f"/v1/jobs/{first.job.id}/retry")
    with api_client(context) as other:
        assert "errored_jobs" not in samples(other)


def test_what_is_zero_is_said_from_the_start(api) -> None:
    found = samples(api)
    for name, labels in (
        ("jobs", {"state": "done", "stage": "simulate", "outcome": "errored"}),
        ("queue_jobs", {"queue": "simulate.mujoco"}),
        ("workers", {"kind": "simulate"}),
        ("model_requests_total", {"model": "openai/gpt-5"}),
        ("stage_seconds_count", {"stage": "simulate", "result": "lost"}),
        ("http_responses_total", {"status": "500"}),
    ):
        assert (labels, 0.0) in found[name], name


def test_metrics_say_what_the_service_stands_on(api, context) -> None:
    facts = {"peak_memory_bytes": 7, "reported_at": datetime.now(UTC) + timedelta(hours=2)}
    report_worker(context, "a", "construct", "verify", **facts)
    report_worker(context, "b", "simulate.mujoco", **facts)
    ago = "UPDATE workers SET last_heartbeat_at = now() - interval '1 minute' WHERE id = 'b'"
    execute(context, ago)
    found = samples(api)
    serving = {labels["queue"]: value for labels, value in found["queue_workers"]}
    assert (serving["construct"], serving["simulate.mujoco"]) == (1, 0)
    lost = {labels["kind"]: value for labels, value in found["workers_lost"]}
    assert lost == {"construct": 0, "simulate": 1}
    assert only(found, "worker_clock_error_seconds") == pytest.approx(7200, abs=30)
    assert found["worker_peak_memory_bytes"] == [({"kind": "construct"}, 7)]
    assert only(found, "artifact_store_up") == only(found, "broker_up") == 1
    assert 0 < only(found, "data_free_bytes") < only(found, "data_size_bytes")


def test_each_request_is_a_line_in_the_log_that_nobody_forges(api, capfd, monkeypatch) -> None:
    # A logger keeps the stream of its first line, and this one is closed with the test.
    monkeypatch.setattr(request_log, "log", structlog.get_logger())
    set_up_logs("info")
    try:
        api.get("/v1/jobs/job_x", headers={"X-Request-ID": "r1"})
        api.get('/v1/jobs/x%0A{"event": "stage_done", "job": "job_1"}')
        api.post("/v1/jobs", json={"task": '\n{"event": "forged"}\n', "model": "x\r\ny"})
    finally:
        structlog.reset_defaults()
    lines = [json.loads(line) for line in capfd.readouterr().err.splitlines() if line]
    assert [line["event"] for line in lines] == ["request"] * 3
    told = [lines[0][name] for name in ("path", "status", "request_id")]
    assert told == ["/v1/jobs/job_x", 404, "r1"]
    # A request has an id of its own, or a harmless given one.
    odd = ["", "x" * 65, 'a" level="error', "a\tb"]
    for given in ("order-17.a_B", *odd):
        told = api.get("/v1/models", headers={"X-Request-ID": given}).headers["x-request-id"]
        assert told
        assert (told == given) is (given not in odd)


def test_health_names_workers_that_are_missing_wrong_or_silent(api, context, sweep) -> None:
    first = checks(api)
    assert api.get("/v1/health").json()["status"] == "degraded"
    assert first["database"]["ok"]
    assert first["broker"]["ok"]
    assert first["workers of construct"]["advice"] == "start a worker for the queue construct"
    now = datetime.now(UTC)
    report_worker(context, "good", "construct", reported_at=now)
    report_worker(context, "late", "construct", reported_at=now - timedelta(hours=1))
    found = checks(api)
    assert found["workers of construct"]["ok"]
    assert not found["clocks"]["ok"]
    assert "late is 3600 s behind" in found["clocks"]["detail"]
    assert "good" not in found["clocks"]["detail"]
    assert "NTP" in found["clocks"]["advice"]

    api.post("/v1/sweeps", json={**sweep, "seeds": [0]})
    for number in range(FEW_LOST - 1):
        report_worker(context, f"w{number}", "construct")
    ago = "last_heartbeat_at - interval '2 minutes'"
    execute(context, f"UPDATE workers SET last_heartbeat_at = {ago}")
    execute(context, "UPDATE jobs SET available_at = now() - interval '61 minutes'")
    # A budget that is used up is told, and nothing that is wrong.
    execute(context, "UPDATE sweeps SET state = 'budget_exhausted'")
    with api_client(context) as later:
        wait_until(lambda: not checks(later)["waiting"]["ok"], 30, "the figures are read")
        found = checks(later)
    assert found["workers of construct"]["detail"] == "0 alive; 1 waiting"
    assert found["waiting"]["detail"] == "the oldest job for 61 min, in construct"
    assert found["waiting"]["advice"] == "start more workers for the queue construct"
    assert found["silent workers"]["detail"] == f"{FEW_LOST + 1} of construct within the last hour"
    assert not found["silent workers"]["ok"]
    assert found["budgets"]["ok"]
    assert found["budgets"]["detail"] == "1 sweeps wait for a larger one"


@contextmanager
def service_behind(context, part: str) -> Iterator[tuple[httpx.Client, FlakyProxy]]:
    """The API, with a proxy that can fall silent before one of its stores."""
    place = getattr(context.settings, f"required_{part}_url")()
    with flaky_proxy(place) as proxy:
        own = {**WITH_KEYS, "metrics_key": SecretStr(METRICS), f"{part}_url": proxy.url}
        with live_api(context, **own) as served, httpx.Client(base_url=served) as client:
            yield client, proxy


def down(client: httpx.Client) -> list[str]:
    """Parts that metrics say are down."""
    found = samples(client, Authorization=f"Bearer {METRICS}")
    return [name for name in PARTS.values() if not only(found, name)]


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("part", ["database", "broker"])
def test_a_store_that_falls_silent_is_named_and_holds_nobody_up(context, part) -> None:
    def ask_for_jobs(url: httpx.URL) -> None:
        httpx.get(url.join("/v1/jobs"), headers={"Authorization": f"Bearer {ADMIN}"}, timeout=40)

    with service_behind(context, part) as (client, proxy):
        wait_until(lambda: all(c["ok"] for c in [*checks(client).values()][:3]), 20, "all work")
        assert down(client) == []
        proxy.hushed = True
        # Requests that need the store, and hang as long as it is silent.
        asking = {"target": ask_for_jobs, "args": (client.base_url,), "daemon": True}
        hanging = [threading.Thread(**asking) for _ in range(12)]
        for thread in hanging:
            thread.start()
        wait_until(lambda: not checks(client)[part]["ok"], 3 * PATIENCE_S, f"{part} fails")
        begun = time.monotonic()
        for _ in range(20):
            assert next(name for name, check in checks(client).items() if not check["ok"]) == part
            assert down(client) == [PARTS[part]]
        # Forty answers: none waited for a store.
        assert time.monotonic() - begun < 2 * PATIENCE_S
        proxy.hushed = False
        wait_until(lambda: checks(client)[part]["ok"], 20, f"{part} is known to work again")
        for thread in hanging:
            thread.join(40)


def test_a_part_says_what_it_said_last_and_does_not_wait(monkeypatch) -> None:
    monkeypatch.setattr(parts, "PATIENCE_S", 0.2)
    silent, asked = threading.Event(), []

    def ask() -> int:
        asked.append(1)
        if silent.is_set():
            time.sleep(0.5)
        return len(asked)

    async def play() -> None:
        part = Part(ask, fresh_s=0.1)
        assert "has not answered yet" in str(part.verdict)
        await asyncio.gather(*(part.renew() for _ in range(5)))
        assert part.verdict == 1
        await part.renew()
        assert len(asked) == 1, "it is fresh"
        silent.set()
        await asyncio.sleep(0.1)
        begun = time.monotonic()
        await part.renew()
        assert time.monotonic() - begun < 0.15
        assert part.verdict == 1
        await asyncio.sleep(0.25)
        assert "has not answered for 0 s" in str(part.verdict)
        assert part.verdict.is_silent
        silent.clear()
        await asyncio.sleep(0.3)
        await part.renew()
        assert part.verdict >= 2, "it answered after all"

    asyncio.run(play())
