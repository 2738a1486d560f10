"""Forecasts of sweeps: when they end and what they come to cost, from what ran."""

from datetime import UTC, datetime, timedelta
from decimal import Decimal

import pytest
from support.clients.tenants import new_tenant
from support.jobs import execute, finish

SPEC = {
    "tasks": ["support-1", "lift-1"],
    "models": ["builtin/expert", "builtin/random"],
    "samples": 10,
    "simulator": "mujoco",
}


@pytest.fixture
def sweep(api) -> str:
    return api.post("/v1/sweeps", json={**SPEC, "budget": {"max_cost_usd": 10}}).json()["id"]


def end(context, model: str, task: str, number: int, cost: str) -> None:
    """So many jobs end, each at this cost."""
    left = number
    for job in context.store.jobs.page(limit=100, state="queued", model=model, task=task)[:number]:
        lease = context.store.leases.claim("construct", owner="w", hint=job.id)
        finish(context, lease, columns={"cost_usd": Decimal(cost)})
        left -= 1
    assert not left


def ahead(api, sweep: str) -> dict:
    return api.get(f"/v1/sweeps/{sweep}/forecast").json()


def test_nothing_is_foretold_of_what_has_not_begun(api, sweep) -> None:
    assert ahead(api, sweep) == {
        "jobs_left": 40,
        "jobs_per_minute": None,
        "ends_at": None,
        "cost_usd_left": 0,
        "cost_usd_total": 0,
        "budget_usd_short": 0,
        "unknown_models": ["builtin/expert", "builtin/random"],
    }
    assert api.get("/v1/sweeps/sweep_0/forecast").status_code == 404


def test_costs_go_by_the_same_model_on_the_same_task_first(api, context, sweep) -> None:
    end(context, "builtin/expert", "support-1", 4, "0.50")
    end(context, "builtin/expert", "lift-1", 1, "1.50")
    # 6 at 0.50 and 9 at 1.50.
    first = ahead(api, sweep)
    assert (first["cost_usd_left"], first["unknown_models"]) == (16.5, ["builtin/random"])
    # On a task of which nothing ended, the mean over the others.
    end(context, "builtin/random", "lift-1", 2, "0.10")
    second = ahead(api, sweep)
    assert second["cost_usd_left"] == pytest.approx(16.5 + 18 * 0.1)
    assert second["unknown_models"] == []


def test_the_budget_lacks_what_its_own_jobs_come_to_cost(api, context, sweep) -> None:
    end(context, "builtin/expert", "support-1", 2, "1.00")
    assert ahead(api, sweep)["budget_usd_short"] == pytest.approx(18 - 10)
    api.put(f"/v1/sweeps/{sweep}/budget", json={"max_cost_usd": 100})
    assert ahead(api, sweep)["budget_usd_short"] == 0
    api.put(f"/v1/sweeps/{sweep}/budget", json={"max_requests": 100})
    assert ahead(api, sweep)["budget_usd_short"] is None


def test_a_job_that_has_cost_something_costs_only_the_rest(api, context, sweep) -> None:
    end(context, "builtin/expert", "support-1", 5, "1.00")
    before = ahead(api, sweep)["cost_usd_left"]
    execute(
        context,
        "UPDATE jobs SET cost_usd = 0.75 WHERE id = (SELECT id FROM jobs "
        "WHERE state = 'queued' AND model = 'builtin/expert' LIMIT 1)",
    )
    assert ahead(api, sweep)["cost_usd_left"] == pytest.approx(before - 0.75)


def test_the_rate_is_over_time_that_passes_and_the_end_follows_from_it(api, context, sweep) -> None:
    execute(context, "UPDATE events SET at = now() - interval '10 minutes'")
    end(context, "builtin/expert", "support-1", 4, "0")
    assert ahead(api, sweep)["jobs_per_minute"] is None, "four tell nothing yet"
    end(context, "builtin/expert", "support-1", 1, "0")
    faulty = context.store.leases.claim("construct", owner="w")
    context.store.leases.give_up(faulty, "no key", reason="missing_key")
    seen = ahead(api, sweep)
    assert seen["jobs_per_minute"] == pytest.approx(0.5, rel=0.02), "faults tell nothing"
    end_at = datetime.fromisoformat(seen["ends_at"])
    assert abs(end_at - datetime.now(UTC) - timedelta(minutes=68)) < timedelta(minutes=2)
    api.post(f"/v1/sweeps/{sweep}/pause")
    assert ahead(api, sweep)["jobs_per_minute"] is None
    # What ended before it was resumed says nothing of what comes.
    api.post(f"/v1/sweeps/{sweep}/resume")
    assert ahead(api, sweep)["ends_at"] is None


def test_one_more_end_moves_a_rate_of_hundreds_by_little(api, context) -> None:
    many = {**SPEC, "models": ["builtin/idle"], "samples": 110}
    sweep = api.post("/v1/sweeps", json=many).json()["id"]
    execute(context, "UPDATE events SET at = now() - interval '1 day'")
    execute(
        context,
        "UPDATE jobs SET state = 'done', outcome = 'success', success = true, finished_at = "
        "now() - number * interval '60 seconds' FROM (SELECT id, row_number() OVER (PARTITION BY "
        "task) AS number FROM jobs) AS ended WHERE ended.id = jobs.id AND number <= 75",
    )
    before = ahead(api, sweep)["jobs_per_minute"]
    assert before == pytest.approx(2, rel=0.03)
    end(context, "builtin/idle", "support-1", 1, "0")
    assert ahead(api, sweep)["jobs_per_minute"] == pytest.approx(before, rel=0.02)


def test_a_budget_is_set_by_its_owner_only(guarded) -> None:
    ada, bob = (new_tenant(guarded, name, "read", "submit") for name in ("ada", "bob"))
    sweep = ada.post("/v1/sweeps", SPEC)["id"]
    path = f"/v1/sweeps/{sweep}/budget"
    assert bob.ask("PUT", path, json={}).status_code == 403
    answer = ada.ask("PUT", path, json={"max_requests": 7})
    assert answer.json()["budget"]["max_requests"] == 7
    assert ada.ask("PUT", path, json={"usd": 1}).status_code == 422
    ada.post(f"/v1/sweeps/{sweep}/cancel")
    assert ada.ask("PUT", path, json={}).status_code == 409
