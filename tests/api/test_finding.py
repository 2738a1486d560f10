"""Finding jobs and sweeps: filters, beginnings of ids, and the artifacts of a job."""

import hashlib

import pytest
from support.jobs import attach, claim, finish

SWEEP = {"tasks": ["support-1", "lift-1"], "models": ["builtin/idle"], "samples": 8}


@pytest.fixture
def ids(api) -> list[str]:
    api.post("/v1/sweeps", json=SWEEP)
    return sorted(job["id"] for job in api.get("/v1/jobs").json()["jobs"])


@pytest.fixture
def ended(ids, context) -> str:
    """A job that failed with a reason, two flags and two files."""
    assert ids
    lease = claim(context)
    attach(context, lease.job.id, {"machine": b"{}", "notes": b"[]"})
    return finish(context, lease, "unsuccessful", reason="too_weak", flags=("unstable", "odd"))


def found(api, **params: str) -> list[str]:
    return [job["id"] for job in api.get("/v1/jobs", params=params).json()["jobs"]]


def test_jobs_are_found_by_how_they_ended(api, ended) -> None:
    for params in (
        {"reason": "too_weak"},
        {"flag": "odd"},
        {"flag": "unstable", "reason": "too_weak", "outcome": "unsuccessful", "state": "done"},
    ):
        assert found(api, **params) == [ended]
    assert found(api, outcome="success") == []
    assert found(api, model="builtin/random") == []


def test_jobs_are_found_by_the_beginnings_of_their_ids(api, ids) -> None:
    for length in (4, 5, 6, 12, 24):
        prefix = ids[3][:length]
        assert sorted(found(api, id_prefix=prefix)) == [i for i in ids if i.startswith(prefix)]
    assert found(api, id_prefix="sweep_") == []


@pytest.mark.parametrize("prefix", ["job", "job_%", "job_G", "", "job_ ", "x" * 50])
def test_what_begins_no_id_is_refused(api, ids, prefix) -> None:
    assert ids
    for path in ("/v1/jobs", "/v1/sweeps"):
        assert api.get(path, params={"id_prefix": prefix}).status_code == 422


def test_sweeps_are_found_by_the_beginnings_of_their_ids(api) -> None:
    made = [api.post("/v1/sweeps", json=SWEEP).json()["id"] for _ in range(3)]
    for id_ in made:
        page = api.get("/v1/sweeps", params={"id_prefix": id_[:20]}).json()["sweeps"]
        assert [sweep["id"] for sweep in page] == [id_]


@pytest.mark.parametrize(
    ("name", "value", "choice"),
    [
        ("task", "lift-9", "lift-1"),
        ("model", "builtin/idel", "builtin/idle"),
        ("reason", "to_weak", "too_weak"),
        ("flag", "stable", "unstable"),
    ],
)
def test_a_value_that_no_job_can_have_is_refused_with_the_choices(
    api, ended, name, value, choice
) -> None:
    assert ended
    answer = api.get("/v1/jobs", params={name: value})
    (error,) = answer.json()["errors"]
    assert (answer.status_code, error["field"]) == (422, name)
    assert choice in error["choices"]
    assert repr(value) in error["message"]


def test_a_reason_is_not_refused_while_no_job_has_any(api, ids) -> None:
    assert ids
    assert found(api, reason="lost_worker") == []
    assert found(api, flag="unstable") == []


def test_all_artifacts_of_a_job_are_listed_and_given(api, ended) -> None:
    files = api.get(f"/v1/jobs/{ended}/artifacts").json()
    assert [file["name"] for file in files] == ["machine", "notes"]
    for file in files:
        answer = api.get(f"/v1/jobs/{ended}/artifacts/{file['name']}")
        assert answer.headers["content-type"] == file["media_type"]
        assert answer.headers["etag"] == f'"{file["hash"]}"'
        assert hashlib.sha256(answer.content).hexdigest() == file["hash"]
        assert len(answer.content) == file["size"]


def test_artifacts_that_are_not_there(api, ids) -> None:
    assert api.get(f"/v1/jobs/{ids[0]}/artifacts").json() == []
    assert api.get(f"/v1/jobs/{ids[0]}/artifacts/machine").status_code == 404
    assert api.get("/v1/jobs/job_0/artifacts").status_code == 404


def test_a_misspelled_outcome_or_state_is_refused_with_the_values(api) -> None:
    for name, value, right in (("outcome", "sucess", "success"), ("state", "held", "on_hold")):
        answer = api.get("/v1/jobs", params={name: value})
        assert answer.status_code == 422
        (issue,) = answer.json()["errors"]
        assert issue["field"] == name
        assert right in issue["choices"]
        assert issue["message"] == f"there is no such value: {value!r}"
        assert right in answer.json()["detail"]
