"""Metrics, the request log and health: what an operator sees."""

import json
import shutil
from datetime import UTC, datetime, timedelta

import pytest
import structlog
from prometheus_client.parser import text_string_to_metric_families
from support.jobs import claim, execute, journal_entry, report_worker
from support.servers.live_api import api_client
from support.servers.stacks import wait_until

from buildarena_api.http.probes import ARTIFACTS_FRESH_S
from buildarena_store import Usage


def samples(api) -> dict[str, list[tuple[dict[str, str], float]]]:
    text = api.get("/v1/metrics").text
    found: dict[str, list[tuple[dict[str, str], float]]] = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found.setdefault(sample.name, []).append((sample.labels, sample.value))
    return found


def test_metrics_say_what_the_jobs_say(api, context, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": [0, 1, 2]})
    first = claim(context)
    usage = Usage(requests=1, input_tokens=70, output_tokens=7)
    context.store.journal.append(first, journal_entry(usage=usage))
    context.store.leases.give_up(first, "no key", reason="missing_key")
    found = samples(api)
    queued = {"state": "queued", "stage": "construct", "outcome": ""}
    assert (queued, 2.0) in found["buildarena_jobs"]
    assert found["buildarena_errored_jobs"] == [({"reason": "missing_key"}, 1.0)]
    assert found["buildarena_queue_jobs"] == [({"queue": "construct"}, 2.0)]
    assert found["buildarena_queue_oldest_seconds"][0][1] >= 0
    model = {"model": "builtin/idle"}
    assert found["buildarena_model_requests_total"] == [(model, 1.0)]
    assert ({**model, "direction": "input"}, 70.0) in found["buildarena_model_tokens_total"]
    assert found["buildarena_sweeps"] == [({"state": "active"}, 1.0)]
    held = {"stage": "construct", "result": "fault"}
    assert (held, 1.0) in found["buildarena_stage_seconds_count"]
    assert ({**held, "le": "+Inf"}, 1.0) in found["buildarena_stage_seconds_bucket"]


def test_metrics_count_requests_by_route_and_status(api) -> None:
    for _ in range(3):
        api.get("/v1/jobs/job_x")
    counted = samples(api)["buildarena_http_request_seconds_count"]
    assert ({"route": "/v1/jobs/{job_id}", "method": "GET", "status": "404"}, 3.0) in counted


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("order-17.a_B", True),
        ("", False),
        ("x" * 65, False),
        ('a" level="error', False),
        ("a\tb", False),
    ],
)
def test_a_request_has_an_id_of_its_own_or_a_harmless_given_one(api, given, kept) -> None:
    answer = api.get("/v1/models", headers={"X-Request-ID": given})
    assert (answer.headers["x-request-id"] == given) is kept
    assert answer.headers["x-request-id"]


def test_each_request_is_a_line_in_the_log(api) -> None:
    with structlog.testing.capture_logs(
        processors=[structlog.contextvars.merge_contextvars]
    ) as lines:
        api.get("/v1/jobs/job_x", headers={"X-Request-ID": "r1"})
    (line,) = [line for line in lines if line["event"] == "request"]
    assert (line["path"], line["status"], line["request_id"]) == ("/v1/jobs/job_x", 404, "r1")


def test_what_people_write_can_not_forge_lines_of_the_log(api, capfd, monkeypatch) -> None:
    from buildarena_api.http import log as request_log
    from buildarena_pipeline.runtime.logs import set_up_logs

    # A logger keeps the stream of its first line, and this one is closed with the test.
    monkeypatch.setattr(request_log, "log", structlog.get_logger())
    set_up_logs("info")
    try:
        forged = '/v1/jobs/x%0A{"event": "stage_done", "job": "job_1"}'
        api.get(forged)
        api.post("/v1/jobs", json={"task": '\n{"event": "forged"}\n', "model": "x\r\ny"})
    finally:
        structlog.reset_defaults()
    lines = [line for line in capfd.readouterr().err.splitlines() if line]
    assert lines
    events = [json.loads(line)["event"] for line in lines]
    assert set(events) == {"request"}, lines


def test_health_names_a_worker_whose_clock_is_wrong(api, context) -> None:
    now = datetime.now(UTC)
    report_worker(context, "good", "construct", own_time=now)
    report_worker(context, "late", "construct", own_time=now - timedelta(hours=1))
    checks = {check["name"]: check for check in api.get("/v1/health").json()["checks"]}
    clocks = checks["clocks"]
    assert not clocks["ok"]
    assert "late is 3600 s behind" in clocks["detail"]
    assert "good" not in clocks["detail"]
    assert "NTP" in clocks["advice"]


def test_metrics_say_what_the_service_stands_on(api, context) -> None:
    facts = {"peak_memory_bytes": 7, "own_time": datetime.now(UTC) + timedelta(hours=2)}
    report_worker(context, "a", "construct", "verify", **facts)
    report_worker(context, "b", "simulate.mujoco", **facts)
    execute(context, "UPDATE workers SET seen_at = now() - interval '1 minute' WHERE id = 'b'")
    found = samples(api)
    serving = {labels["queue"]: value for labels, value in found["buildarena_queue_workers"]}
    assert serving["construct"] == 1
    assert serving["simulate.mujoco"] == 0
    lost = {labels["kind"]: value for labels, value in found["buildarena_workers_lost"]}
    assert lost == {"construct": 0, "simulate": 1}
    ((_, error),) = found["buildarena_worker_clock_error_seconds"]
    assert error == pytest.approx(7200, abs=30)
    assert found["buildarena_worker_peak_memory_bytes"] == [({"kind": "construct"}, 7)]
    for name in ("artifact_store_up", "broker_up"):
        assert found[f"buildarena_{name}"] == [({}, 1)]
    ((_, free),) = found["buildarena_data_free_bytes"]
    ((_, size),) = found["buildarena_data_size_bytes"]
    assert 0 < free < size
    used, most = (
        {pool["pool"]: value for pool, value in found[f"buildarena_database_connections_{name}"]}
        for name in ("used", "limit")
    )
    assert set(used) == set(most) == {"ordinary", "watching", "exporting"}
    assert all(used[pool] <= most[pool] for pool in most)


def test_metrics_notice_an_artifact_store_that_fails(api, context) -> None:
    folder = context.settings.data / "artifacts"
    shutil.rmtree(folder)
    folder.write_text("no folder")
    wait_until(
        lambda: samples(api)["buildarena_artifact_store_up"] == [({}, 0)],
        4 * ARTIFACTS_FRESH_S,
        "the store is asked again",
    )


def test_metrics_say_how_many_jobs_are_at_hand_in_each_queue(api, context, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": [0, 1, 2]})
    assert "buildarena_queue_running" not in samples(api)
    for _ in range(2):
        claim(context)
    # Another process has read nothing yet.
    with api_client(context) as other:
        assert samples(other)["buildarena_queue_running"] == [({"queue": "construct"}, 2)]
