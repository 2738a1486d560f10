"""Shared jobs without shared harm: two keys, A and B, that want the same jobs."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from starlette.testclient import TestClient
from support.clients.tenants import Tenant, everything, new_tenant, operator
from support.stages import work

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_backend.process.context import Context

JOB = {"task": "support-1", "model": "paid/idle"}
SWEEP = {"tasks": ["support-1"], "models": ["paid/idle"], "seeds": [0]}
SESSION = {"task": "support-1", "agent": "mason", "seed": 0}


@pytest.fixture
def a(guarded: TestClient) -> Tenant:
    return new_tenant(guarded, "A")


@pytest.fixture
def b(guarded: TestClient) -> Tenant:
    return new_tenant(guarded, "B")


def sweep_of(who: Tenant, **more: Any) -> str:
    return who.post("/v1/sweeps", {**SWEEP, **more})["id"]


def the_job(who: Tenant) -> dict[str, Any]:
    (job,) = who.get("/v1/jobs")["data"]
    return job


def payer_of(context: Context) -> str | None:
    (job,) = context.store.jobs.page(limit=10)
    return job.payer


def run_until(context: Context, state: str) -> None:
    """Brings the one job into a state."""
    if state in {"queued", "on_hold"}:
        return
    lease = context.store.leases.claim("construct", owner="w")
    assert lease is not None
    if state == "errored":
        context.store.leases.give_up(lease, "no key", reason="missing_key")


def spent(who: Tenant, guarded: TestClient) -> int:
    (key,) = [key for key in operator(guarded).get("/v1/keys")["data"] if key["id"] == who.id]
    return key["budget"]["used_requests"]


def budget(who: Tenant, guarded: TestClient, requests: int) -> None:
    body = {"max_requests": requests}
    answer = operator(guarded).ask("PUT", f"/v1/keys/{who.id}/budget", json=body)
    assert answer.is_success, answer.text


# Limits


def test_anothers_limits_never_become_my_result(a, b, context) -> None:
    tight = b.post("/v1/jobs", {**JOB, "limits": {"max_requests": 1}})
    work(context)
    mine = a.post("/v1/jobs", JOB)
    assert mine["state"] == "queued"
    work(context)
    assert a.get(f"/v1/jobs/{mine['id']}")["outcome"] == "construction_failed"
    (task,) = a.get("/v1/leaderboard")["tasks"]
    rows = {row["decoding"].get("limits", {}).get("max_requests"): row for row in task["rows"]}
    assert {limit: row["counted"] for limit, row in rows.items()} == {None: 1, 1: 0}
    # The same limits are the same job, however they are spelled.
    ids = {mine["id"], tight["id"]}
    for name, one, spelled in (
        *(("max_tokens", 1, 1), ("max_duration_s", 2, 2.0), ("max_cost_usd", 1, 1.0)),
        ("max_requests", 2, 2),
    ):
        job, again = (a.post("/v1/jobs", {**JOB, "limits": {name: n}}) for n in (one, spelled))
        assert job["id"] == again["id"]
        ids.add(job["id"])
    assert len(ids) == 6


# Commands over shared jobs


@pytest.mark.parametrize(
    ("command", "state"),
    [("pause", "queued"), ("cancel", "queued"), ("cancel", "running"), ("pause", "errored")],
)
def test_a_command_hands_jobs_to_an_active_sweep_of_another(a, b, context, command, state) -> None:
    mine, theirs = sweep_of(a), sweep_of(b)
    run_until(context, state)
    assert (the_job(a)["key_id"], payer_of(context)) == (a.id, mine)
    a.post(f"/v1/sweeps/{mine}/{command}")
    assert the_job(b)["key_id"] == b.id
    assert state == "errored" or (the_job(b)["state"], payer_of(context)) == (state, theirs)


@pytest.mark.parametrize("state", ["running", "on_hold"])
def test_a_paused_sweep_wants_its_jobs_and_lets_them_wait(a, b, context, state) -> None:
    mine, theirs = sweep_of(a), sweep_of(b)
    b.post(f"/v1/sweeps/{theirs}/pause")
    run_until(context, state)
    if state == "on_hold":
        a.post(f"/v1/sweeps/{mine}/pause")
    assert the_job(a)["state"] == state
    a.post(f"/v1/sweeps/{mine}/cancel")
    job = the_job(b)
    assert (job["state"], job["key_id"], payer_of(context)) == ("on_hold", b.id, theirs)
    b.post(f"/v1/sweeps/{theirs}/resume")
    assert the_job(b)["state"] == "queued"
    work(context)
    assert the_job(b)["outcome"] == "construction_failed"


def test_a_lease_ends_when_its_job_goes_to_somebody_who_waits(a, b, context) -> None:
    mine, theirs = sweep_of(a), sweep_of(b)
    b.post(f"/v1/sweeps/{theirs}/pause")
    lease = context.store.leases.claim("construct", owner="w")
    a.post(f"/v1/sweeps/{mine}/cancel")
    assert context.store.leases.heartbeat([lease]) == {}
    assert context.store.jobs.attempts(lease.job.id)[0].finished_at is not None


def test_a_sweep_that_ran_out_of_budget_wants_its_jobs(a, b, context) -> None:
    theirs = sweep_of(b, budget={"max_requests": 1}, models=["paid/idle", "paid/expert"])
    work(context)
    assert b.get(f"/v1/sweeps/{theirs}")["state"] == "budget_exhausted"
    mine = sweep_of(a, models=["paid/expert"])
    a.post(f"/v1/sweeps/{mine}/cancel")
    left = b.get(f"/v1/jobs?sweep={theirs}&model=paid/expert")["data"]
    assert [(job["state"], job["key_id"]) for job in left] == [("on_hold", b.id)]


def test_nobody_pays_after_cancelling(a, b, guarded, context) -> None:
    for who in (a, b):
        budget(who, guarded, 1000)
    mine, theirs = sweep_of(a, budget={"max_requests": 1000}), sweep_of(b)
    a.post(f"/v1/sweeps/{mine}/cancel")
    work(context)
    assert the_job(b)["outcome"] == "construction_failed"
    assert spent(a, guarded) == 0
    assert spent(b, guarded) == the_job(b)["usage"]["requests"] > 0
    assert b.get(f"/v1/sweeps/{mine}")["budget"]["used_requests"] == 0
    assert theirs == payer_of(context)


@pytest.mark.ci
def test_what_was_spent_before_a_hand_over_stays_where_it_was_spent(a, b, guarded, context) -> None:
    expert = {"models": ["paid/expert"]}
    mine, theirs = sweep_of(a, **expert), sweep_of(b, **expert)
    work(context, steps=1)
    before = the_job(a)["usage"]["requests"]
    assert before > 0
    a.post(f"/v1/sweeps/{mine}/cancel")
    assert payer_of(context) == theirs
    # Budgets that are set afterwards count what each did pay.
    for who in (a, b):
        budget(who, guarded, 1000)
    work(context)
    later = the_job(b)["usage"]["requests"] - before
    assert (spent(a, guarded), spent(b, guarded)) == (before, later)


def test_a_keys_budget_stop_leaves_the_jobs_that_another_key_wants(a, b, guarded, context) -> None:
    budget(a, guarded, 1)
    seeds = [0, 1]
    sweep_of(a, seeds=seeds)
    for seed in seeds:
        b.post("/v1/jobs", {**JOB, "seed": seed})
    work(context)
    assert {job["state"] for job in b.get("/v1/jobs")["data"]} == {"done"}
    assert spent(a, guarded) <= 1


# Retry


def test_retrying_never_touches_a_job_of_another_key(a, b, guarded, context) -> None:
    for who in (a, b):
        budget(who, guarded, 1000)
    mine, theirs = sweep_of(a), sweep_of(b)
    run_until(context, "errored")
    b.post(f"/v1/sweeps/{theirs}/retry")
    work(context)
    assert the_job(a)["outcome"] == "errored"
    b.post(f"/v1/jobs/{the_job(a)['id']}/retry", status=403)
    a.post(f"/v1/sweeps/{mine}/retry")
    work(context)
    assert the_job(a)["outcome"] == "construction_failed"
    assert (spent(b, guarded), spent(a, guarded)) == (0, the_job(a)["usage"]["requests"])


def test_a_job_that_its_owner_left_is_retried_at_ones_own_expense(a, b, guarded, context) -> None:
    for who in (a, b):
        budget(who, guarded, 1000)
    mine = sweep_of(a)
    run_until(context, "errored")
    a.post(f"/v1/sweeps/{mine}/cancel")
    theirs = sweep_of(b)
    b.post(f"/v1/sweeps/{theirs}/retry")
    assert payer_of(context) == theirs
    work(context)
    assert spent(a, guarded) == 0
    assert spent(b, guarded) == the_job(b)["usage"]["requests"] > 0


def test_a_retried_job_is_never_paid_by_a_cancelled_sweep(a, context) -> None:
    first, second = sweep_of(a), sweep_of(a)
    run_until(context, "errored")
    assert payer_of(context) == first
    a.post(f"/v1/sweeps/{first}/cancel")
    a.post(f"/v1/jobs/{the_job(a)['id']}/retry")
    assert (the_job(a)["state"], payer_of(context)) == ("queued", second)


# Single jobs


def test_a_job_that_another_key_asked_for_singly_goes_on(a, b, context) -> None:
    mine = sweep_of(a)
    b.post("/v1/jobs", JOB)
    a.post(f"/v1/sweeps/{mine}/cancel")
    assert (the_job(b)["state"], the_job(b)["key_id"]) == ("queued", b.id)
    assert payer_of(context) is None


def test_cancelling_a_shared_job_only_ends_ones_own_wish(a, b) -> None:
    mine, theirs = sweep_of(a), sweep_of(b)
    job = the_job(a)["id"]
    # B takes back its payload, A's stays; so what A cancels later ends.
    assert b.post(f"/v1/jobs/{job}/cancel")["key_id"] == a.id
    assert the_job(a)["state"] == "queued"
    b.post("/v1/sweeps", SWEEP)
    assert a.post(f"/v1/jobs/{job}/cancel")["key_id"] == b.id
    assert the_job(b)["state"] == "queued"
    # A took its payload back: B's cancel does not bring it back to A.
    assert b.post(f"/v1/jobs/{job}/cancel")["outcome"] == "cancelled"
    assert {mine, theirs} <= {sweep["id"] for sweep in a.get("/v1/sweeps")["data"]}


def test_who_neither_owns_nor_wants_a_job_cannot_cancel_it_but_admins(
    a, b, guarded, context
) -> None:
    sweep_of(a)
    path = f"/v1/jobs/{the_job(a)['id']}/cancel"
    before = everything(context.store.database)
    b.post(path, status=403)
    assert everything(context.store.database) == before
    sweep_of(b)
    assert operator(guarded).post(path)["outcome"] == "cancelled"


# Refusals


def test_a_refused_request_changes_nothing(a, b, context) -> None:
    mine = sweep_of(a)
    session = a.post("/v1/sessions", SESSION)["id"]
    a.post(f"/v1/jobs/{session}/cancel")
    task = {"content": EXAMPLE.encode(), "headers": {"Content-Type": "application/yaml"}}
    assert a.ask("POST", "/v1/tasks", **task).status_code == 201
    done = a.post("/v1/jobs", {**JOB, "seed": 9})["id"]
    open_session = a.post("/v1/sessions", {**SESSION, "seed": 1})["id"]
    work(context)
    before = everything(context.store.database)
    other = EXAMPLE.replace("final_mass: 200", "final_mass: 300").encode()
    retitled = EXAMPLE.replace("A bridge over", "My bridge over").encode()
    refused = [
        (a, "POST", "/v1/sessions", {"json": SESSION}),
        (b, "POST", "/v1/sessions", {"json": SESSION}),
        (b, "POST", "/v1/sessions", {"json": {**SESSION, "seed": 7}}),
        (a, "POST", "/v1/sessions", {"json": {**SESSION, "agent": "new", "task": "no-task"}}),
        (a, "POST", "/v1/sessions", {"json": {**SESSION, "agent": "new\n"}}),
        (b, "POST", "/v1/tasks", {**task, "content": other}),
        (a, "POST", "/v1/tasks", {**task, "content": retitled}),
        (b, "POST", f"/v1/sweeps/{mine}/cancel", {}),
        (b, "POST", f"/v1/jobs/{done}/cancel", {}),
        (a, "POST", f"/v1/jobs/{done}/cancel", {}),
        (a, "POST", f"/v1/jobs/{done}/retry", {}),
        (a, "POST", f"/v1/sweeps/{mine}/resume", {}),
        (a, "POST", "/v1/sweeps", {"json": {**SWEEP, "models": ["nobody"]}}),
        (a, "POST", "/v1/jobs", {"json": {**JOB, "task": "none"}}),
        (b, "POST", f"/v1/sessions/{open_session}/submit", {}),
        (b, "POST", f"/v1/sessions/{open_session}/calls", {"json": {"tool": "start"}}),
        (a, "POST", f"/v1/sessions/{session}/submit", {}),
        (a, "POST", f"/v1/sessions/{session}/calls", {"json": {"tool": "start"}}),
        (a, "PUT", f"/v1/keys/{a.id}/budget", {"json": {"max_requests": 5}}),
        (a, "POST", f"/v1/keys/{b.id}/revoke", {}),
    ]
    for who, method, path, more in refused:
        answer = who.ask(method, path, **more)
        assert 400 <= answer.status_code < 500, (path, answer.text)
    assert everything(context.store.database) == before


# Names


def test_of_two_keys_that_use_a_new_name_at_once_one_gets_it(a, b) -> None:
    def upload(who: Tenant, number: int) -> int:
        text = EXAMPLE.replace("final_mass: 200", f"final_mass: {200 + number}")
        headers = {"Content-Type": "application/yaml"}
        return who.ask("POST", "/v1/tasks", content=text.encode(), headers=headers).status_code

    def opened(who: Tenant, number: int) -> int:
        return who.ask("POST", "/v1/sessions", json={**SESSION, "seed": number}).status_code

    tries = [(who, number) for number in range(4) for who in (a, b)]
    with ThreadPoolExecutor(8) as pool:
        for use in (upload, opened):
            statuses = list(pool.map(use, *zip(*tries, strict=True)))
            assert sorted(statuses) == [201] * 4 + [403] * 4
            good = zip(tries, statuses, strict=True)
            assert len({who.id for (who, _), status in good if status == 201}) == 1
