"""Custom tasks over HTTP: uploaded, refused with line and field, versioned, listed."""

import json

import pytest
import yaml

from buildarena_api.routes.tasks import EXAMPLE

YAML = {"Content-Type": "application/yaml"}
OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")


def upload(api, text: str, **headers: str):
    return api.post("/v1/tasks", content=text.encode(), headers={**YAML, **headers})


def test_a_task_is_added_shown_and_listed(api) -> None:
    answer = upload(api, EXAMPLE)
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert (made["name"], made["custom"], made["current"]) == ("narrow-gap", True, True)
    assert (made["indicator"], made["unit"]) == ("load", "mass units")
    assert made["created_at"] is not None
    shown = api.get(answer.headers["location"])
    assert shown.json() == made == api.get("/v1/tasks/narrow-gap").json()
    assert shown.json()["document"]["scenario"]["placement"] == {
        "kind": "span",
        "gap": 3.0,
        "lowest_center": 6.0,
    }
    names = {task["name"]: task for task in api.get("/v1/tasks").json()}
    assert list(names)[:2] == ["transport-1", "transport-2"]
    assert [name for name, task in names.items() if task["custom"]] == ["narrow-gap"]
    assert names["narrow-gap"]["version"] == made["version"]


def test_the_same_content_again_changes_nothing(api) -> None:
    first = upload(api, EXAMPLE)
    respelled = yaml.safe_dump(yaml.safe_load(EXAMPLE), sort_keys=True)
    again = upload(api, f"# a comment\n{respelled}")
    assert again.status_code == 200
    assert again.json() == first.json()
    assert again.headers["location"] == first.headers["location"]


def test_a_shown_document_can_be_uploaded_as_it_is(api) -> None:
    first = upload(api, EXAMPLE).json()
    assert upload(api, json.dumps(first["document"])).status_code == 200
    copied = {**api.get("/v1/tasks/lift-1").json()["document"], "name": "my-lift"}
    copy = upload(api, json.dumps(copied)).json()
    # What can change a score is the same, whatever its name.
    assert copy["version"] == api.get("/v1/tasks/lift-1").json()["version"]


def test_a_changed_task_is_a_new_version_and_the_old_one_stays(api) -> None:
    old, new = upload(api, EXAMPLE).json(), upload(api, OTHER).json()
    assert old["version"] != new["version"]
    assert api.get("/v1/tasks/narrow-gap").json() == new
    shown = api.get("/v1/tasks/narrow-gap", params={"version": old["version"]}).json()
    assert shown == {**old, "current": False}
    assert api.get("/v1/tasks/narrow-gap", params={"version": "0" * 12}).status_code == 404
    # The old content again is known, and says that it is not what new submissions get.
    again = upload(api, EXAMPLE)
    assert (again.status_code, again.json()["current"]) == (200, False)


def test_what_is_not_part_of_a_version_can_not_be_changed_alone(api) -> None:
    upload(api, EXAMPLE)
    answer = upload(api, EXAMPLE.replace("A bridge over", "The bridge over"))
    assert answer.status_code == 409
    assert "another title" in answer.json()["detail"]
    assert api.get("/v1/tasks/narrow-gap").json()["title"].startswith("A bridge")


@pytest.mark.parametrize(
    ("text", "line", "field", "choice"),
    [
        (EXAMPLE.replace("gap: 3}", "gap: -3}"), 12, "scenario.placement.gap", None),
        (EXAMPLE.replace("  duration_s", "  duration"), 7, "scenario.duration", "duration_s"),
        (EXAMPLE.replace("narrow-gap", "support-1"), 1, "name", None),
        ("# mine\n" + EXAMPLE.replace("narrow-gap", "lift-1"), 2, "name", None),
        (EXAMPLE + "title: again\n", 15, "title", None),
        ("a: &a [x]\nb: *a\n", 1, "", None),
        ("a: [\n", 2, "", None),
        ("", None, "", None),
    ],
)
def test_a_bad_task_is_refused_with_line_and_field(api, text, line, field, choice) -> None:
    answer = upload(api, text)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    (problem, *_) = (e for e in answer.json()["errors"] if e["field"] == field)
    assert problem["line"] == line
    if choice is not None:
        assert choice in problem["choices"]
    assert not any(task["custom"] for task in api.get("/v1/tasks").json())


def test_a_body_of_another_kind_or_size_is_refused(api) -> None:
    assert api.post("/v1/tasks", json=yaml.safe_load(EXAMPLE)).status_code == 415
    assert api.post("/v1/tasks", content=EXAMPLE.encode()).status_code == 415
    large = upload(api, EXAMPLE + "# " + "x" * 70_000)
    assert large.status_code == 413
    assert "65,536" in large.json()["detail"]
    strange = api.post("/v1/tasks", content=b"name: \xff", headers=YAML)
    assert (strange.status_code, strange.json()["errors"][0]["line"]) == (422, 1)
    assert not any(task["custom"] for task in api.get("/v1/tasks").json())


def test_a_reader_who_has_the_tasks_gets_none_until_one_is_added(api) -> None:
    for path in ("/v1/tasks", "/v1/tasks/narrow-gap"):
        upload(api, EXAMPLE)
        tag = api.get(path).headers["etag"]
        assert api.get(path, headers={"If-None-Match": tag}).status_code == 304
    upload(api, OTHER)
    assert api.get("/v1/tasks/narrow-gap", headers={"If-None-Match": tag}).status_code == 200


@pytest.mark.parametrize("name", ["nowhere", "support-9"])
def test_a_task_that_is_not_there(api, name) -> None:
    answer = api.get(f"/v1/tasks/{name}")
    assert answer.status_code == 404
    assert name in answer.json()["detail"]


def test_jobs_sweeps_and_sessions_get_the_newest_version(api) -> None:
    upload(api, EXAMPLE)
    new = upload(api, OTHER).json()
    job = api.post("/v1/jobs", json={"task": "narrow-gap", "model": "builtin/idle"}).json()
    assert (job["task"], job["task_version"]) == ("narrow-gap", new["version"])
    sweep = {"tasks": ["support-1", "narrow-gap"], "models": ["builtin/idle"], "samples": 2}
    assert api.post("/v1/sweeps", json=sweep).json()["jobs"] == 4
    assert api.post("/v1/sweeps/estimate", json=sweep).json()["jobs"] == 4
    opened = api.post("/v1/sessions", json={"task": "narrow-gap", "agent": "me"}).json()
    assert opened["statement"] == new["statement"]
    refused = api.post("/v1/jobs", json={"task": "narrow", "model": "builtin/idle"}).json()
    assert {"narrow-gap", "support-1"} <= set(refused["errors"][0]["choices"])
