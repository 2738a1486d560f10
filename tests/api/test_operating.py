"""Cancelling, retrying, pausing, watching."""

import json
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from support.servers.live_api import live_api


@pytest.fixture
def submitted(api, sweep) -> str:
    return api.post("/v1/sweeps", json=sweep).json()["id"]


def states(api, sweep_id: str) -> list[str]:
    return sorted(
        job["outcome"] or job["state"]
        for job in api.get("/v1/jobs", params={"sweep": sweep_id}).json()["jobs"]
    )


def test_a_job_is_cancelled_once(api, submitted) -> None:
    job_id = api.get("/v1/jobs", params={"sweep": submitted}).json()["jobs"][0]["id"]
    assert api.post(f"/v1/jobs/{job_id}/cancel").json()["outcome"] == "cancelled"
    again = api.post(f"/v1/jobs/{job_id}/cancel")
    assert again.status_code == 409
    assert "has ended already" in again.json()["detail"]


@pytest.mark.usefixtures("submitted")
def test_only_errored_jobs_are_retried(api, context) -> None:
    lease = context.store.leases.claim("construct", owner="w")
    assert api.post(f"/v1/jobs/{lease.job.id}/retry").status_code == 409
    context.store.leases.give_up(lease, "gone", reason="lost_worker")
    errored = api.get("/v1/jobs", params={"outcome": "errored"}).json()["jobs"]
    assert [(job["id"], job["reason"]) for job in errored] == [(lease.job.id, "lost_worker")]
    assert api.post(f"/v1/jobs/{lease.job.id}/retry").json()["state"] == "queued"


def test_a_paused_sweep_starts_nothing_until_it_is_resumed(api, context, submitted) -> None:
    assert api.post(f"/v1/sweeps/{submitted}/pause").json()["state"] == "paused"
    assert states(api, submitted) == ["on_hold", "on_hold"]
    assert context.store.leases.claim("construct", owner="w") is None
    assert api.post(f"/v1/sweeps/{submitted}/pause").status_code == 409
    assert api.post(f"/v1/sweeps/{submitted}/resume").json()["state"] == "active"
    assert context.store.leases.claim("construct", owner="w") is not None


def test_cancelling_a_sweep_spares_jobs_that_another_wants(api, sweep, submitted) -> None:
    other = api.post("/v1/sweeps", json={**sweep, "seeds": [1]}).json()["id"]
    assert api.post(f"/v1/sweeps/{submitted}/cancel").json()["state"] == "cancelled"
    assert states(api, submitted) == ["cancelled", "queued"]
    assert states(api, other) == ["queued"]
    assert api.post(f"/v1/sweeps/{submitted}/resume").status_code == 409


def test_a_submission_with_a_key_is_done_once(api, sweep) -> None:
    headers = {"Idempotency-Key": "k1"}
    first = api.post("/v1/sweeps", json=sweep, headers=headers)
    second = api.post("/v1/sweeps", json=sweep, headers=headers)
    assert first.json()["id"] == second.json()["id"]
    assert len(api.get("/v1/sweeps").json()["sweeps"]) == 1
    other = api.post("/v1/sweeps", json={**sweep, "seeds": [9]}, headers=headers)
    assert other.status_code == 409
    assert len(api.get("/v1/jobs").json()["jobs"]) == 2


def test_submissions_with_one_key_at_the_same_time_are_one(api, sweep) -> None:
    def submit(_: int) -> httpx.Response:
        return api.post("/v1/sweeps", json=sweep, headers={"Idempotency-Key": "k2"})

    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(submit, range(8)))
    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1


def test_an_estimate_stores_nothing(api, sweep) -> None:
    payload = {**sweep, "models": ["builtin/idle", "openai/gpt-4o"], "seeds": [0, 1, 2, 3]}
    estimate = api.post("/v1/sweeps/estimate", json=payload).json()
    assert estimate["jobs"] == 8
    free, paid = estimate["models"]
    assert (free["cost_usd"], free["requests"]) == (0.0, 0.0)
    # gpt-4o at 2.5 and 10 dollars per million tokens, support-1's means of the paper.
    assert paid["cost_usd"] == pytest.approx(4 * (629911.1 * 2.5 + 27311.1 * 10) / 1e6, rel=1e-3)
    assert api.get("/v1/sweeps").json()["sweeps"] == []
    # Two models on one task are one claim.
    power = estimate["power"]
    assert (power["trials"], power["trials_for_ten_points"]) == (4, 388)
    assert power["on_a_task"] == power["overall"] is None


def test_an_oversized_body_is_refused(api) -> None:
    answer = api.post("/v1/sweeps", content=b"x" * 5_000_000)
    assert answer.status_code == 413
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_body_that_lies_about_its_size_is_refused(api) -> None:
    def endless():
        for _ in range(50):
            yield b"x" * 100_000

    assert api.post("/v1/sweeps", content=endless()).status_code == 413


def test_answers_say_browsers_to_be_careful(api) -> None:
    headers = api.get("/v1/health", headers={"Origin": "http://127.0.0.1"}).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert "access-control-allow-origin" not in headers


def read_events(url: str, count: int, **headers: str) -> list[tuple[int, str, dict[str, object]]]:
    found, current = [], {}
    with httpx.stream("GET", url, headers=headers, timeout=20) as answer:
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if line:
                current[name] = value
            elif "data" in current:
                found.append((int(current["id"]), current["event"], json.loads(current["data"])))
                current = {}
            if len(found) == count:
                return found
    return found


def test_events_come_as_they_happen_and_from_where_one_left_off(context, submissions) -> None:
    from buildarena_pipeline.catalog.specs import SweepSpec

    done = submissions.submit_sweep(
        SweepSpec(tasks=["support-1"], models=["builtin/idle"], seeds=[0, 1])
    )
    with live_api(context) as url, ThreadPoolExecutor(1) as threads:
        stream = f"{url}/v1/sweeps/{done.sweep.id}/events"
        first = read_events(stream, 3)
        assert {kind for _, kind, _ in first} == {"queued", "submitted"}
        rest = threads.submit(read_events, stream, 2, **{"Last-Event-ID": str(first[-1][0])})
        lease = context.store.leases.claim("construct", owner="w")
        context.store.leases.hand_back(lease)
        assert [(kind, data["job"]) for _, kind, data in rest.result()] == [
            ("running", lease.job.id),
            ("queued", lease.job.id),
        ]
        assert httpx.get(f"{url}/v1/jobs/job_x/events").status_code == 404
