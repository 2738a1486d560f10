"""Metrics, the request log and health: what an operator sees."""

import json
import platform
import shutil
import time
from datetime import UTC, datetime, timedelta

import pytest
import structlog
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import text
from support.jobs import claim, execute, journal_entry, report_worker
from support.servers.live_api import api_client
from support.servers.stacks import wait_until

from buildarena_api.http.probes import ARTIFACTS_FRESH_S
from buildarena_pipeline import __version__
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
    assert ({"queue": "construct"}, 2.0) in found["buildarena_queue_jobs"]
    assert found["buildarena_queue_oldest_seconds"][0][1] >= 0
    model = {"model": "builtin/idle"}
    assert (model, 1.0) in found["buildarena_model_requests_total"]
    assert ({**model, "direction": "input"}, 70.0) in found["buildarena_model_tokens_total"]
    assert ({"state": "active"}, 1.0) in found["buildarena_sweeps"]
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


@pytest.mark.ci
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
    for _ in range(2):
        claim(context)
    # Another process has read nothing yet.
    with api_client(context) as other:
        assert ({"queue": "construct"}, 2) in samples(other)["buildarena_queue_running"]


def test_what_is_zero_is_said_from_the_start(api) -> None:
    found = {
        (name, *sorted(labels.values())): value
        for name, all_labels in samples(api).items()
        for labels, value in all_labels
    }
    for series in (
        ("buildarena_jobs", "", "construct", "queued"),
        ("buildarena_jobs", "done", "errored", "simulate"),
        ("buildarena_sweeps", "budget_exhausted"),
        ("buildarena_queue_jobs", "simulate.mujoco"),
        ("buildarena_queue_oldest_seconds", "construct"),
        ("buildarena_queue_running", "construct"),
        ("buildarena_workers", "simulate"),
        ("buildarena_model_requests_total", "openai/gpt-5"),
        ("buildarena_model_tokens_total", "input", "openai/gpt-5"),
        ("buildarena_model_cost_usd_total", "openai/gpt-5"),
        ("buildarena_stage_seconds_count", "lost", "simulate"),
        ("buildarena_verifications_total", "refuted"),
        ("buildarena_http_responses_total", "500"),
        ("buildarena_postgres_connections", "idle in transaction (aborted)"),
    ):
        assert found[series] == 0, series


def test_a_reason_that_no_job_has_any_more_is_zero(api, context, sweep) -> None:
    api.post("/v1/sweeps", json=sweep)
    job = claim(context)
    context.store.leases.give_up(job, "no key", reason="missing_key")
    api.post(f"/v1/jobs/{job.job.id}/retry")
    assert samples(api)["buildarena_errored_jobs"] == [({"reason": "missing_key"}, 0.0)]


def test_metrics_say_which_program_answers(api) -> None:
    (build,) = samples(api)["buildarena_build_info"]
    assert build == ({"version": __version__, "python": platform.python_version()}, 1.0)


def test_responses_are_counted_by_status(api) -> None:
    api.get("/v1/jobs/job_x")
    assert ({"status": "404"}, 1.0) in samples(api)["buildarena_http_responses_total"]


def test_metrics_say_how_the_database_is(api, context) -> None:
    with context.store.database.engine.connect() as connection:
        connection.execute(text("SELECT 1"))  # and no commit
        time.sleep(0.2)
        found = samples(api)
    assert found["buildarena_postgres_size_bytes"][0][1] > 1e6
    connections = {labels["state"]: n for labels, n in found["buildarena_postgres_connections"]}
    assert connections["idle in transaction"] >= 1
    ((_, used),) = found["buildarena_postgres_server_connections"]
    ((_, most),) = found["buildarena_postgres_server_connections_limit"]
    assert sum(connections.values()) <= used + 5
    assert used < most
    ((_, open_s),) = found["buildarena_postgres_oldest_transaction_seconds"]
    assert 0.1 < open_s < 60
    assert "jobs" in {labels["table"] for labels, _ in found["buildarena_postgres_dead_rows"]}
    ended = {labels["result"]: n for labels, n in found["buildarena_postgres_transactions_total"]}
    assert ended["committed"] > 0
    assert found["buildarena_postgres_deadlocks_total"][0][1] >= 0
