import re

import pytest
from support.jobs import claim, finish, report_worker
from support.servers.stacks import wait_until

from buildarena_api.routes.health import FEW_LOST
from buildarena_benchmark import builtin_tasks


def end_job(context, outcome: str) -> None:
    lease = claim(context)
    if outcome == "errored":
        context.store.leases.give_up(lease, "gone", reason="lost_worker")
    else:
        finish(context, lease, outcome, 100.0, metrics={"parts": 7})


def test_an_empty_leaderboard_is_an_empty_page(api) -> None:
    lists = {"tracks": [], "tasks": [], "overall": [], "ranked": []}
    answer = api.get("/v1/leaderboard").json()
    assert {"does_not_span", "not_driven", "unstable"} <= {f["name"] for f in answer.pop("flags")}
    nobody = {"track": None, "verdict": None}
    assert answer == {**nobody, **lists}


def test_the_leaderboard_counts_scored_jobs_and_shows_errored_ones(api, context, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": [0, 1, 2]})
    for outcome in ("success", "unsuccessful", "errored"):
        end_job(context, outcome)
    board = api.get("/v1/leaderboard").json()
    (task,) = board["tasks"]
    (row,) = task["rows"]
    assert (row["trials"], row["successes"], row["errored"]) == (2, 1, 1)
    assert row["success_rate"] == 0.5
    assert 0 < row["success_low"] < 0.5 < row["success_high"] < 1
    assert (row["indicator_mean"], row["parts_mean"], row["baseline"]) == (50.0, 7.0, True)


def test_a_board_of_errors_alone_has_no_numbers_and_no_nan(api, context, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": [0]})
    end_job(context, "errored")
    answer = api.get("/v1/leaderboard")
    row = answer.json()["tasks"][0]["rows"][0]
    assert (row["trials"], row["errored"], row["success_rate"]) == (0, 1, None)
    assert "NaN" not in answer.text


def test_an_unknown_track_or_task_names_the_choices(api) -> None:
    problem = api.get("/v1/leaderboard", params={"task": "x"}).json()
    assert "lift-1" in problem["errors"][0]["choices"]
    assert api.get("/v1/leaderboard", params={"track": "x"}).status_code == 422


def test_the_catalogue_lists_what_can_be_submitted(api) -> None:
    tasks = {task["name"]: task for task in api.get("/v1/tasks").json()}
    assert tasks.keys() == builtin_tasks().keys()
    assert tasks["support-1"]["indicator"]
    models = {model["name"]: model for model in api.get("/v1/models").json()}
    assert models["builtin/expert"]["baseline"]
    assert {module["name"] for module in api.get("/v1/modules").json()} >= {"Brace", "Torch"}


def test_health_tells_which_workers_are_missing(api, context) -> None:
    health = api.get("/v1/health").json()
    assert health["status"] == "degraded"
    checks = {check["name"]: check for check in health["checks"]}
    assert checks["database"]["ok"]
    assert checks["broker"]["ok"]
    assert checks["workers of construct"]["advice"] == "start a worker for the queue construct"
    report_worker(context, "w", "construct")
    checks = {check["name"]: check for check in api.get("/v1/health").json()["checks"]}
    assert checks["workers of construct"]["ok"]


def test_health_names_what_waits_and_who_fell_silent(api, context, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": [0]})
    for number in range(FEW_LOST + 1):
        report_worker(context, f"w{number}", "construct")
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE workers SET seen_at = seen_at - interval '2 minutes'")
        connection.exec_driver_sql("UPDATE jobs SET available_at = now() - interval '61 minutes'")

    def checks() -> dict[str, dict]:
        return {check["name"]: check for check in api.get("/v1/health").json()["checks"]}

    wait_until(lambda: not checks()["waiting"]["ok"], 30, "the figures are read again")
    assert checks()["workers of construct"]["detail"] == "0 alive; 1 waiting"
    assert checks()["waiting"]["detail"] == "the oldest job for 61 min, in construct"
    assert checks()["waiting"]["advice"] == "start more workers for the queue construct"
    assert checks()["silent workers"]["detail"] == "4 of construct within the last hour"
    assert not checks()["silent workers"]["ok"]


def test_a_budget_that_is_used_up_is_told_and_not_wrong(api, context, sweep) -> None:
    sweep_id = api.post("/v1/sweeps", json={**sweep, "seeds": [0]}).json()["id"]
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql(
            "UPDATE sweeps SET state = 'budget_exhausted' WHERE id = %s", (sweep_id,)
        )

    def budgets() -> dict:
        (check,) = [c for c in api.get("/v1/health").json()["checks"] if c["name"] == "budgets"]
        return check

    wait_until(lambda: budgets()["advice"], 30, "the figures are read again")
    assert budgets()["ok"]
    assert budgets()["detail"] == "1 sweeps wait for a larger one"


def test_the_docs_page_is_there(api) -> None:
    page = api.get("/docs")
    assert page.status_code == 200
    sources = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert sources
    for source in sources:
        assert source.startswith("/"), "the page must not need another server"
        assert api.get(source).status_code == 200


@pytest.mark.parametrize(
    "name",
    ["..%2f..%2fetc%2fpasswd", "....//etc/passwd", "machine%00", "%2e%2e%2fmachine", "machine/.."],
)
def test_names_that_leave_the_store_lead_nowhere(api, name) -> None:
    job_id = api.post("/v1/jobs", json={"task": "lift-1", "model": "builtin/idle"}).json()["id"]
    answer = api.get(f"/v1/jobs/{job_id}/{name}")
    assert answer.status_code in {404, 422} or answer.json()["id"] == job_id
    assert "root:" not in answer.text


@pytest.mark.parametrize(
    "lure", ["'; DROP TABLE jobs; --", '" OR 1=1 --', "%' OR '1'='1", "builtin/idle'/*"]
)
def test_sql_in_texts_is_text(api, lure) -> None:
    api.post("/v1/jobs", json={"task": "lift-1", "model": "builtin/idle"})
    for name in ("task", "model", "outcome", "sweep"):
        answer = api.get("/v1/jobs", params={name: lure})
        assert answer.status_code in {200, 404, 422}
        assert answer.json().get("jobs", []) == []
    assert api.post("/v1/jobs", json={"task": lure, "model": lure}).status_code == 422
    assert api.get("/v1/leaderboard", params={"task": lure, "model": lure}).status_code < 500
    assert len(api.get("/v1/jobs").json()["jobs"]) == 1
