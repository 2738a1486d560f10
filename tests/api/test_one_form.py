"""What every operation has in common: errors, lists, bodies, methods and headers."""

import yaml
from sqlalchemy import text as sql
from support.clients.tenants import new_tenant
from support.jobs import execute
from support.servers.live_api import live_api

from buildarena_backend.catalog.workflows import workflow_sources

JOB = {"task": "support-1", "model": "builtin/idle"}
YAML = {"Content-Type": "application/yaml"}


def code_of(answer) -> tuple[int, str]:
    assert answer.headers["content-type"] == "application/problem+json", answer.text
    return answer.status_code, answer.json()["code"]


def test_unknown_and_repeated_parameters_are_refused_with_the_near_names(api) -> None:
    for path in ("/v1/jobs", "/v1/tasks", "/v1/leaderboard", "/v1/sweeps", "/v1/health"):
        assert code_of(api.get(f"{path}?outcom=success")) == (422, "unknown_parameter")
    answer = api.get("/v1/jobs?outcom=success").json()
    assert "did you mean outcome?" in answer["detail"]
    assert "outcome" in answer["errors"][0]["choices"]
    assert code_of(api.get("/v1/jobs?sort=cost&sort=created")) == (422, "repeated_parameter")
    assert code_of(api.get("/v1/modules?set=basic&task=lift-1"))[1] == "contradictory_parameters"
    two = "/v1/jobs?task=lift-1&task=support-1&model=builtin/idle&model=builtin/random"
    assert api.get(two).status_code == 200


def test_repeated_filters_are_lists(api, submit_job) -> None:
    ids = {task: submit_job(task=task) for task in ("support-1", "lift-1", "lift-2")}
    found = api.get("/v1/jobs?task=lift-1&task=lift-2&state=queued&state=done").json()["data"]
    assert {job["id"] for job in found} == {ids["lift-1"], ids["lift-2"]}


def test_pages_of_what_is_in_memory_follow_each_other(api) -> None:
    every = api.get("/v1/tasks").json()
    names, cursor = [], {}
    while cursor is not None:
        page = api.get("/v1/tasks", params={"limit": 7, **cursor}).json()
        names += [task["name"] for task in page["data"]]
        cursor = page["next_cursor"] and {"cursor": page["next_cursor"]}
    assert names == [task["name"] for task in every["data"]]
    assert code_of(api.get("/v1/tasks?cursor=x")) == (422, "invalid_cursor")


def test_codes_say_what_was_not_found(api) -> None:
    for path, code in (
        ("/v1/jobs/job_0", "job_not_found"),
        ("/v1/sweeps/sweep_0", "sweep_not_found"),
        ("/v1/tasks/nothing", "task_not_found"),
        ("/v1/sessions/job_0", "session_not_found"),
        ("/v1/verifications/check_0", "verification_not_found"),
        ("/v1/nothing", "path_not_found"),
    ):
        assert code_of(api.get(path)) == (404, code), path


def test_wrong_bodies_are_told_by_place_and_near_names(api) -> None:
    headers = {"Content-Type": "application/json"}
    broken = api.post("/v1/jobs", content=b'{"task": "lift-1",\n "model" 5}', headers=headers)
    assert code_of(broken) == (422, "invalid_json")
    assert "line 2, column 10" in broken.json()["detail"]
    typo = api.post("/v1/sweeps", json={"tasks": ["lift-1"], "models": ["x"], "sedes": [1]})
    assert code_of(typo) == (422, "unknown_field")
    assert "did you mean seeds?" in typo.json()["detail"]
    inner = api.post("/v1/jobs", json={**JOB, "decoding": {"temprature": 1}}).json()
    assert inner["errors"][0]["choices"] == ["temperature", "top_p", "max_tokens"]
    assert code_of(api.post("/v1/jobs", json={**JOB, "task": "lift-9"})) == (422, "unknown_name")


def test_sweeps_and_tasks_are_json_or_yaml(api) -> None:
    sweep = {"tasks": ["lift-1"], "models": ["builtin/idle"], "samples": 2}
    made = api.post("/v1/sweeps", content=yaml.safe_dump(sweep), headers=YAML)
    assert (made.status_code, made.json()["jobs"]) == (201, 2)
    wrong = api.post("/v1/sweeps", content=b"tasks: [lift-1\n", headers=YAML)
    assert code_of(wrong) == (422, "invalid_yaml")
    assert wrong.json()["errors"][0]["line"] == 2
    bomb = b"a: &a [x]\nb: *a\n"
    assert code_of(api.post("/v1/sweeps", content=bomb, headers=YAML)) == (422, "invalid_yaml")


def test_head_is_get_without_its_body(context, submit_job) -> None:
    import httpx

    job = submit_job()
    with live_api(context) as url:
        for path in ("/v1/jobs", f"/v1/jobs/{job}", "/v1/health", "/", f"/v1/jobs/{job}/events"):
            answer = httpx.head(url + path, timeout=5)
            assert (answer.status_code, answer.content) == (200, b""), path
        assert httpx.head(f"{url}/v1/jobs/job_0").status_code == 404


def test_answers_say_how_many_requests_are_left(guarded) -> None:
    ada = new_tenant(guarded, "ada", "read")
    first, second = (ada.ask("GET", "/v1/tasks").headers for _ in range(2))
    assert int(first["ratelimit-limit"]) > int(first["ratelimit-remaining"]) > 0
    assert int(second["ratelimit-remaining"]) == int(first["ratelimit-remaining"]) - 1
    assert 1 <= int(first["ratelimit-reset"]) <= 60


def test_the_missing_scope_is_the_one_that_is_needed(guarded) -> None:
    for scope in ("read", "submit"):
        who = new_tenant(guarded, "ada", scope)
        refused = who.ask("POST", "/v1/keys/key_0/revoke")
        assert code_of(refused) == (403, "scope_missing")
        assert "'admin'" in refused.json()["detail"]


def test_a_request_that_is_sent_again_creates_nothing_twice(api) -> None:
    again = {"Idempotency-Key": "monday"}
    bodies = {
        "/v1/jobs": (JOB, {**JOB, "seed": 5}),
        "/v1/sessions": ({"task": "lift-1", "agent": "me"}, {"task": "lift-1", "agent": "you"}),
        "/v1/keys": ({"name": "a", "scopes": ["read"]}, {"name": "b", "scopes": ["read"]}),
        "/v1/sweeps": ({"tasks": ["lift-1"], "models": ["builtin/idle"], "samples": 1}, JOB),
    }
    for path, (body, other) in bodies.items():
        first, second = (api.post(path, json=body, headers=again) for _ in range(2))
        assert (first.status_code, second.status_code) == (201, 200), path
        assert first.json()["id"] == second.json()["id"]
        changed = api.post(path, json=other, headers=again)
        assert changed.status_code in {409, 422}, path
    # A secret is answered once; another key's request of the same name is another request.
    again_made = api.post("/v1/keys", json=bodies["/v1/keys"][0], headers=again).json()
    assert again_made["secret"] is None
    assert len(api.get("/v1/keys").json()["data"]) == 1


def test_a_stores_failure_names_no_path(api, context, submit_job, monkeypatch) -> None:
    from buildarena_backend.errors import ArtifactStoreError

    job = submit_job()

    def fails(*_: object) -> None:
        raise ArtifactStoreError("/var/lib/arena/artifacts is full")

    monkeypatch.setattr(type(context.store.jobs), "files", fails)
    answer = api.get(f"/v1/jobs/{job}/artifacts")
    assert code_of(answer) == (503, "store_unavailable")
    assert "/var" not in answer.text


def test_other_workflows_jobs_are_no_sessions(api, context, submit_job) -> None:
    """Of any workflow, in any state: 404, and nothing changes."""
    job = submit_job()
    row = sql("SELECT to_jsonb(jobs) FROM jobs WHERE id = :id")
    call = {"tool": "start", "arguments": {}}
    workflows = [*workflow_sources({}), "file", "made-up"]
    assert "five-role" in workflows
    for workflow in workflows:
        for state, queue in (("running", "external"), ("queued", "construct"), ("done", "x")):
            execute(
                context,
                "UPDATE jobs SET state = :state, queue = :queue, lease_token = 1, track_config = "
                "jsonb_set(track_config, '{workflow}', to_jsonb(CAST(:workflow AS text)))",
                {"state": state, "queue": queue, "workflow": workflow},
            )
            with context.store.database.transaction() as connection:
                before = connection.execute(row, {"id": job}).scalar()
            for method, rest, body in (
                *(("GET", "", None), ("GET", "/machine", None), ("POST", "/calls", call)),
                *(("POST", "/test-trials", None), ("POST", "/submit", None)),
            ):
                answer = api.request(method, f"/v1/sessions/{job}{rest}", json=body)
                assert code_of(answer) == (404, "session_not_found"), (workflow, state, rest)
            with context.store.database.transaction() as connection:
                assert connection.execute(row, {"id": job}).scalar() == before
