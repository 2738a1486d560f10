"""Jobs and sweeps: submitted once, watched, paused, cancelled, retried, and what is foretold."""

import json
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from decimal import Decimal

import httpx
import pytest
from support.jobs import claim, execute, finish
from support.servers.live_api import live_api

from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_backend.states import AttemptResult, JobState

JOB = {"task": "support-1", "model": "builtin/idle", "seed": 3}
TWO = {"tasks": ["support-1", "lift-1"], "models": ["builtin/expert", "builtin/random"]}
TWO |= {"samples": 10, "simulator": "mujoco", "budget": {"max_cost_usd": 10}}


@pytest.fixture
def submitted(api, sweep) -> str:
    return api.post("/v1/sweeps", json=sweep).json()["id"]


def states(api, sweep_id: str) -> list[str]:
    found = api.get("/v1/jobs", params={"sweep": sweep_id}).json()["data"]
    return sorted(job["outcome"] or job["state"] for job in found)


def test_a_job_and_a_sweep_are_accepted_and_found_again(api, sweep) -> None:
    answer = api.post("/v1/jobs", json=JOB)
    assert answer.status_code == 201
    job = api.get(answer.headers["location"]).json()
    assert {name: job[name] for name in JOB} == JOB
    assert (job["state"], job["stage"], job["outcome"]) == ("queued", "construct", None)
    assert job["attempts"] == []
    assert api.post("/v1/jobs", json=JOB).json()["id"] == job["id"]
    answer = api.post("/v1/sweeps", json=sweep)
    assert (answer.status_code, answer.json()["jobs"]) == (201, 2)
    shown = api.get(answer.headers["location"]).json()
    assert (shown["state"], shown["progress"]["total"]) == ("active", 2)
    assert shown["progress"]["stages"] == {"construct queued": 2}
    jobs = api.get("/v1/jobs", params={"sweep": shown["id"]}).json()["data"]
    assert {job["seed"] for job in jobs} == {0, 1}


def test_a_bad_submission_is_refused_whole_and_names_its_field(api, sweep) -> None:
    for change, field, choice in (
        ({"tasks": ["bridge"]}, "tasks[0]", "support-1"),
        ({"models": ["builtin/expert", "gpt-9"]}, "models[1]", "openai/gpt-5"),
        ({"workflow": "chaos"}, "workflow", "five-role"),
        ({"prompts": "secret"}, "prompts", "default"),
        *(({"seeds": [bad]}, "seeds[0]", None) for bad in (-1, 1.5, "1", True, 2**53)),
        *(({"seeds": seeds}, "seeds", None) for seeds in ([], [0] * 100_001)),
        *(({name: []}, name, None) for name in ("tasks", "models")),
        ({"samples": 0, "seeds": None}, "samples", None),
        ({"sample": 3}, "sample", None),
        ({"decoding": {"temperature": 9}}, "decoding.temperature", None),
        ({"limits": {"max_requests": 0}}, "limits.max_requests", None),
    ):
        answer = api.post("/v1/sweeps", json={**sweep, **change})
        assert answer.status_code == 422, change
        errors = {error["field"]: error for error in answer.json()["errors"]}
        assert field in errors
        assert choice is None or choice in errors[field]["choices"]
    for field, bad in (("task", "x"), ("model", "x"), ("seed", -1)):
        errors = api.post("/v1/jobs", json={**JOB, field: bad}).json()["errors"]
        assert [error["field"] for error in errors] == [field]
    assert api.get("/v1/jobs").json()["data"] == []
    assert api.get("/v1/sweeps").json()["data"] == []


def test_a_submission_with_a_key_is_done_once(api, sweep) -> None:
    def submit(_: int, **change: object) -> httpx.Response:
        headers = {"Idempotency-Key": "monday"}
        return api.post("/v1/sweeps", json={**sweep, **change}, headers=headers)

    with ThreadPoolExecutor(8) as threads:
        answers = [*threads.map(submit, range(8)), submit(0)]
    assert sorted(answer.status_code for answer in answers) == [200] * 8 + [201]
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert len(api.get("/v1/sweeps").json()["data"]) == 1
    assert submit(0, seeds=[9]).status_code == 409
    assert len(api.get("/v1/jobs").json()["data"]) == 2


@pytest.mark.usefixtures("submitted")
def test_a_job_is_cancelled_once_and_only_errored_ones_are_retried(api, context) -> None:
    lease = claim(context)
    path = f"/v1/jobs/{lease.job.id}"
    assert api.post(f"{path}/retry").status_code == 409
    context.store.leases.give_up(lease, "gone", reason="lost_worker")
    errored = api.get("/v1/jobs", params={"outcome": "errored"}).json()["data"]
    assert [(job["id"], job["reason"]) for job in errored] == [(lease.job.id, "lost_worker")]
    assert api.post(f"{path}/retry").json()["state"] == "queued"
    assert api.post(f"{path}/cancel").json()["outcome"] == "cancelled"
    again = api.post(f"{path}/cancel")
    assert (again.status_code, "has ended already" in again.json()["detail"]) == (409, True)


def test_a_paused_sweep_starts_nothing_a_cancelled_one_spares_others(
    api, context, sweep, submitted
) -> None:
    assert api.post(f"/v1/sweeps/{submitted}/pause").json()["state"] == "paused"
    assert states(api, submitted) == ["on_hold", "on_hold"]
    assert context.store.leases.claim("construct", owner="w") is None
    assert api.post(f"/v1/sweeps/{submitted}/pause").status_code == 409
    assert api.post(f"/v1/sweeps/{submitted}/resume").json()["state"] == "active"
    assert states(api, submitted) == ["queued", "queued"]
    other = api.post("/v1/sweeps", json={**sweep, "seeds": [1]}).json()["id"]
    assert api.post(f"/v1/sweeps/{submitted}/cancel").json()["state"] == "cancelled"
    assert states(api, submitted) == ["cancelled", "queued"]
    assert states(api, other) == ["queued"]
    assert api.post(f"/v1/sweeps/{submitted}/resume").status_code == 409


def test_an_estimate_stores_nothing(api, sweep) -> None:
    payload = {**sweep, "models": ["builtin/idle", "openai/gpt-4o"], "seeds": [0, 1, 2, 3]}
    estimate = api.post("/v1/sweeps/estimate", json=payload).json()
    assert estimate["jobs"] == 8
    free, paid = estimate["models"]
    assert (free["usage"]["cost_usd"], free["usage"]["requests"]) == (0.0, 0)
    # gpt-4o at 2.5 and 10 dollars per million tokens, support-1's means of the paper.
    wanted = 4 * (629911.1 * 2.5 + 27311.1 * 10) / 1e6
    assert paid["usage"]["cost_usd"] == pytest.approx(wanted, rel=1e-3)
    ceilings = [
        api.post("/v1/sweeps/estimate", json=payload | more).json()["max_cost_usd"]
        for more in ({}, {"limits": {"max_cost_usd": 0.5}}, {"budget": {"max_cost_usd": 7}})
    ]
    assert ceilings == [40, 2, 7]
    assert api.get("/v1/sweeps").json()["data"] == []
    # Two models on one task are one claim.
    power = estimate["power"]
    assert (power["trials"], power["samples_for_10pp_effect"]) == (4, 388)
    assert power["min_detectable_effect_per_task"] == power["overall"] is None


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


def test_events_come_as_they_happen_and_from_where_one_left_off(context, submitted) -> None:
    with live_api(context) as url, ThreadPoolExecutor(1) as threads:
        stream = f"{url}/v1/sweeps/{submitted}/events"
        first = read_events(stream, 3)
        assert {kind for _, kind, _ in first} == {"queued", "submitted"}
        rest = threads.submit(read_events, stream, 2, **{"Last-Event-ID": str(first[-1][0])})
        lease = claim(context)
        context.store.leases.hand_back(lease)
        told = [(kind, data["job_id"]) for _, kind, data in rest.result()]
        assert told == [("running", lease.job.id), ("queued", lease.job.id)]
        assert httpx.get(f"{url}/v1/jobs/job_x/events").status_code == 404


def test_whoever_has_read_the_jobs_hears_only_what_happened_since(api, context, submitted) -> None:
    assert api.get(f"/v1/sweeps/{submitted}").json()["last_event"] == 0
    events = context.store.events.after(0, sweep_id=submitted)
    execute(context, "UPDATE events SET at = at - interval '6 seconds'")
    seen = api.get(f"/v1/sweeps/{submitted}").json()["last_event"]
    assert seen == events[-1].id
    assert api.get("/v1/sweeps").json()["data"][0]["last_event"] == seen
    finish(context, claim(context))
    assert api.get(f"/v1/sweeps/{submitted}").json()["last_event"] == seen
    since = context.store.events.after(seen, sweep_id=submitted)
    assert "done" in {event.kind for event in since}


def test_troubles_of_a_sweep_are_counted_by_what_they_are(api, context, submitted) -> None:
    assert api.get(f"/v1/sweeps/{submitted}/faults").json()["data"] == []
    other = api.post("/v1/jobs", json=JOB).json()["id"]
    fault = (AttemptResult.FAULT, "provider answered 503")
    lost = (AttemptResult.LOST, None)
    for number, (result, note) in enumerate((fault, fault, fault, lost)):
        lease = claim(context, job=None if number else other)
        with context.store.database.transaction() as connection:
            context.store.leases.advance(
                lease, to=JobState.QUEUED, connection=connection, result=result, note=note
            )
        api.post(f"/v1/jobs/{other}/cancel")
    found = api.get(f"/v1/sweeps/{submitted}/faults").json()["data"]
    counted = {(one["result"], one["detail"]): one["attempts"] for one in found}
    assert counted == {("fault", "provider answered 503"): 2, ("lost", None): 1}
    assert all(one["jobs"] <= one["attempts"] and one["model"] == "builtin/idle" for one in found)


def test_requests_that_hang_or_are_sent_again_are_reported(api, context, submitted) -> None:
    lease = claim(context)
    failures = ["HTTP 503: busy", "HTTP 503: busy", "HTTP 429: slow down"]
    asked = {"stage": "plan", "role": "planner", "request_hash": "0", "latency_s": 1.0}
    reply = {"text": "", "calls": [], "finish": "stop"}
    sent = {"usage": Usage(requests=1), "tries": 4, "failures": failures}
    entry = JournalEntry(sequence=0, **asked, reply=reply, **sent)
    context.store.journal.append(lease, entry)
    path = f"/v1/sweeps/{submitted}/faults"
    assert "waiting" not in {one["result"] for one in api.get(path).json()["data"]}
    with context.store.database.transaction() as connection:
        for column, table in (
            ("started_at", "jobs"),
            ("started_at", "attempts"),
            ("created_at", "journal"),
        ):
            ago = f"UPDATE {table} SET {column} = now() - interval '8 minutes'"
            connection.exec_driver_sql(ago)
    found = [one for one in api.get(path).json()["data"] if one["result"] != "fault"]
    counted = {(one["result"], one["detail"]): (one["attempts"], one["jobs"]) for one in found}
    assert counted == {
        ("waiting", None): (1, 1),
        ("retried", "HTTP 503: busy"): (2, 1),
        ("retried", "HTTP 429: slow down"): (1, 1),
    }
    job = api.get(f"/v1/jobs/{lease.job.id}").json()
    assert job["retries"] == {"HTTP 503: busy": 2, "HTTP 429: slow down": 1}


@pytest.fixture
def large(api) -> str:
    """A sweep of forty jobs."""
    return api.post("/v1/sweeps", json=TWO).json()["id"]


def end(context, model: str, task: str, number: int, cost: str) -> None:
    """So many jobs end, each at this cost."""
    waiting = context.store.jobs.page(limit=100, state="queued", model=model, task=task)[:number]
    assert len(waiting) == number
    for job in waiting:
        lease = claim(context, job=job.id)
        finish(context, lease, columns={"cost_usd": Decimal(cost)})


def ahead(api, sweep: str) -> dict:
    return api.get(f"/v1/sweeps/{sweep}/forecast").json()


def test_costs_go_by_the_same_model_on_the_same_task_first(api, context, large) -> None:
    assert ahead(api, large) == {
        **dict.fromkeys(("jobs_per_minute", "finish_at")),
        **dict.fromkeys(("remaining_cost_usd", "total_cost_usd", "lacking_budget_usd"), 0),
        "remaining_jobs": 40,
        "unknown_models": ["builtin/expert", "builtin/random"],
    }
    end(context, "builtin/expert", "support-1", 4, "0.50")
    end(context, "builtin/expert", "lift-1", 1, "1.50")
    # 6 at 0.50 and 9 at 1.50.
    first = ahead(api, large)
    assert (first["remaining_cost_usd"], first["unknown_models"]) == (16.5, ["builtin/random"])
    # On a task of which nothing ended, the mean over the others.
    end(context, "builtin/random", "lift-1", 2, "0.10")
    second = ahead(api, large)
    assert second["remaining_cost_usd"] == pytest.approx(16.5 + 18 * 0.1)
    assert second["unknown_models"] == []
    # A job that has cost something costs only the rest.
    spent = "UPDATE jobs SET cost_usd = 0.25 WHERE id = (SELECT id FROM jobs WHERE "
    spent += "state = 'queued' AND model = 'builtin/expert' AND task = 'lift-1' LIMIT 1)"
    execute(context, spent)
    assert ahead(api, large)["remaining_cost_usd"] == pytest.approx(16.5 + 18 * 0.1 - 0.25)
    assert ahead(api, large)["lacking_budget_usd"] == pytest.approx(18.05 - 10)
    for budget, short in (({"max_cost_usd": 100}, 0), ({"max_requests": 100}, None)):
        api.put(f"/v1/sweeps/{large}/budget", json=budget)
        assert ahead(api, large)["lacking_budget_usd"] == short


def test_the_rate_is_over_time_that_passes_and_the_end_follows_from_it(api, context, large) -> None:
    execute(context, "UPDATE events SET at = now() - interval '10 minutes'")
    end(context, "builtin/expert", "support-1", 4, "0")
    assert ahead(api, large)["jobs_per_minute"] is None, "four tell nothing yet"
    end(context, "builtin/expert", "support-1", 1, "0")
    context.store.leases.give_up(claim(context), "no key", reason="missing_key")
    seen = ahead(api, large)
    assert seen["jobs_per_minute"] == pytest.approx(0.5, rel=0.02), "faults tell nothing"
    end_at = datetime.fromisoformat(seen["finish_at"])
    assert abs(end_at - datetime.now(UTC) - timedelta(minutes=68)) < timedelta(minutes=2)
    # While trials wait, jobs that needed none do not tell the rate.
    ended = "WHERE state = 'done' AND outcome <> 'errored'"
    execute(context, f"UPDATE jobs SET outcome = 'construction_failed' {ended}")
    assert ahead(api, large)["jobs_per_minute"] is not None
    one = "SELECT id FROM jobs WHERE state = 'queued' LIMIT 1"
    execute(context, f"UPDATE jobs SET stage = 'simulate' WHERE id = ({one})")
    assert ahead(api, large)["jobs_per_minute"] is None
    execute(context, f"UPDATE jobs SET outcome = 'success' {ended}")
    assert ahead(api, large)["jobs_per_minute"] is not None
    api.post(f"/v1/sweeps/{large}/pause")
    assert ahead(api, large)["jobs_per_minute"] is None
    # What ended before it was resumed says nothing of what comes.
    api.post(f"/v1/sweeps/{large}/resume")
    assert ahead(api, large)["finish_at"] is None
