import pytest

JOB = {"task": "support-1", "model": "builtin/idle", "seed": 3}
MANY = [0] * 100_001


def test_a_job_is_accepted_and_found_again(api) -> None:
    answer = api.post("/v1/jobs", json=JOB)
    assert answer.status_code == 202
    job = api.get(answer.headers["location"]).json()
    assert (job["task"], job["model"], job["seed"]) == ("support-1", "builtin/idle", 3)
    assert (job["state"], job["stage"], job["outcome"]) == ("queued", "construct", None)
    assert job["attempts"] == []
    assert api.post("/v1/jobs", json=JOB).json()["id"] == job["id"]


def test_a_sweep_is_accepted_with_its_progress(api, sweep) -> None:
    answer = api.post("/v1/sweeps", json=sweep)
    assert answer.status_code == 202
    assert answer.json()["jobs"] == 2
    shown = api.get(answer.headers["location"]).json()
    assert shown["progress"]["total"] == 2
    assert shown["progress"]["stages"] == {"construct queued": 2}
    assert shown["state"] == "active"
    jobs = api.get("/v1/jobs", params={"sweep": shown["id"]}).json()["jobs"]
    assert {job["seed"] for job in jobs} == {0, 1}


@pytest.mark.nightly(keep=9)
@pytest.mark.parametrize(
    ("change", "field", "choice"),
    [
        ({"tasks": ["bridge"]}, "tasks[0]", "support-1"),
        ({"models": ["builtin/expert", "gpt-9"]}, "models[1]", "openai/gpt-5"),
        ({"simulator": "unity"}, "simulator", "mujoco"),
        ({"workflow": "chaos"}, "workflow", "five-role"),
        ({"prompts": "secret"}, "prompts", "default"),
        ({"seeds": [0, -1]}, "seeds[1]", None),
        ({"seeds": [1.5]}, "seeds[0]", None),
        ({"seeds": ["1"]}, "seeds[0]", None),
        ({"seeds": [True]}, "seeds[0]", None),
        ({"seeds": [2**53]}, "seeds[0]", None),
        ({"seeds": []}, "seeds", None),
        ({"seeds": MANY}, "seeds", None),
        ({"tasks": []}, "tasks", None),
        ({"models": []}, "models", None),
        ({"samples": 0, "seeds": None}, "samples", None),
        ({"sample": 3}, "sample", None),
        ({"tasks": None}, "tasks", None),
        ({"decoding": {"temperature": 9}}, "decoding.temperature", None),
        ({"limits": {"max_requests": 0}}, "limits.max_requests", None),
    ],
)
def test_a_bad_sweep_is_refused_whole_and_names_its_field(
    api, sweep, change, field, choice
) -> None:
    answer = api.post("/v1/sweeps", json={**sweep, **change})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == 422
    errors = {error["field"]: error for error in problem["errors"]}
    assert field in errors
    if choice is not None:
        assert choice in errors[field]["choices"]
    assert api.get("/v1/jobs").json()["jobs"] == []
    assert api.get("/v1/sweeps").json()["sweeps"] == []


def test_an_oversized_sweep_names_the_largest(api, sweep) -> None:
    big = {**sweep, "models": ["builtin/idle", "builtin/random"], "seeds": None, "samples": 60_000}
    problem = api.post("/v1/sweeps", json=big).json()
    assert problem["status"] == 422
    assert "120,000 jobs; the largest accepted has 100,000" in problem["detail"]
    assert api.get("/v1/sweeps").json()["sweeps"] == []


@pytest.mark.parametrize(
    ("change", "field"),
    [({"task": "x"}, "task"), ({"model": "x"}, "model"), ({"seed": -1}, "seed")],
)
def test_a_bad_job_names_its_field(api, change, field) -> None:
    problem = api.post("/v1/jobs", json={**JOB, **change}).json()
    assert [error["field"] for error in problem["errors"]] == [field]
    assert api.get("/v1/jobs").json()["jobs"] == []


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b"null", b'"x"', b"\xff\xfe"])
def test_what_is_no_object_is_refused(api, body) -> None:
    answer = api.post("/v1/sweeps", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"


def test_pages_of_jobs_hold_each_once(api, sweep) -> None:
    api.post("/v1/sweeps", json={**sweep, "seeds": list(range(7))})
    seen, cursor = [], None
    while True:
        page = api.get("/v1/jobs", params={"limit": 3, **({"cursor": cursor} if cursor else {})})
        seen += [job["id"] for job in page.json()["jobs"]]
        cursor = page.json()["next_cursor"]
        if cursor is None:
            break
    assert len(seen) == len(set(seen)) == 7


@pytest.mark.parametrize("cursor", ["x", "AAAA", "%00", "MjAyNg"])
def test_a_foreign_cursor_is_refused(api, cursor) -> None:
    answer = api.get("/v1/jobs", params={"cursor": cursor})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "cursor"


@pytest.mark.parametrize(
    "path",
    [
        "/v1/jobs/job_x",
        "/v1/sweeps/sweep_x",
        "/v1/jobs?sweep=x",
        "/v1/nothing",
        "/v1/jobs/a/machine",
    ],
)
def test_what_is_not_there_is_a_problem(api, path) -> None:
    answer = api.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    ("path", "params"),
    [("/v1/jobs", {"task": "\0"}), ("/v1/jobs/a%00b", {}), ("/v1/leaderboard", {"task": "\0"})],
)
def test_texts_that_no_database_holds_are_refused(api, path, params) -> None:
    assert api.get(path, params=params).status_code in {404, 422}


@pytest.mark.parametrize("name", ["a\0b", "two\nlines", ""])
def test_a_name_is_one_printable_line(api, sweep, name) -> None:
    answer = api.post("/v1/sweeps", json={**sweep, "name": name})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "name")
