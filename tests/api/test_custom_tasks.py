"""Custom tasks on the leaderboard and in exports: beside the built-in ones, never mixed in."""

import csv
import io

import pytest
from support.clients.tenants import new_tenant
from support.jobs import finish
from support.servers.live_api import api_client, changed

from buildarena_api.routes.tasks import EXAMPLE

YAML = {"Content-Type": "application/yaml"}
OWN = EXAMPLE.replace("{name: load, unit: mass units}", "{name: worth, unit: points}")
OTHER = OWN.replace("final_mass: 200", "final_mass: 300")
MODELS = ["builtin/expert", "builtin/random"]


@pytest.fixture
def end_all(context):
    """Ends all waiting jobs with one indicator; the expert's succeed."""

    def work(indicator: float) -> None:
        while (lease := context.store.leases.claim("construct", owner="w")) is not None:
            won = lease.job.model == "builtin/expert"
            score = ("success", indicator) if won else ("unsuccessful", 0.0)
            finish(context, lease, *score, metrics={"parts": 7})

    return work


def upload(api, text: str) -> dict[str, object]:
    answer = api.post("/v1/tasks", content=text.encode(), headers=YAML)
    assert answer.status_code in {200, 201}, answer.text
    return answer.json()


def sweep(api, *tasks: str) -> None:
    body = {"tasks": list(tasks), "models": MODELS, "samples": 5}
    assert api.post("/v1/sweeps", json=body).status_code == 202


def board_of(api, **params: object) -> dict[str, dict[str, object]]:
    answer = api.get("/v1/leaderboard", params=params)
    assert answer.status_code == 200, answer.text
    return {task["task"]: task for task in answer.json()["tasks"]}


def test_an_own_task_has_its_own_indicator(api, end_all) -> None:
    upload(api, OWN)
    sweep(api, "support-1", "narrow-gap")
    end_all(150.0)
    tasks = board_of(api)
    assert list(tasks) == ["support-1", "narrow-gap"]
    own = tasks["narrow-gap"]
    assert (own["custom"], own["indicator"], own["unit"]) == (True, "worth", "points")
    assert [row["rank"] for row in own["rows"]] == [1, 2]
    assert not tasks["support-1"]["custom"]


def test_results_of_two_versions_do_not_mix(api, end_all) -> None:
    old = upload(api, OWN)
    sweep(api, "narrow-gap")
    end_all(150.0)
    before = board_of(api)["narrow-gap"]
    assert (before["version"], before["rows"][0]["indicator_mean"]) == (old["version"], 150.0)
    new = upload(api, OTHER)
    # Until the new version has results, the old one's are shown under its own name.
    assert board_of(api)["narrow-gap"]["version"] == old["version"]
    sweep(api, "narrow-gap")
    end_all(250.0)
    after = board_of(api)["narrow-gap"]
    assert (after["version"], after["outdated"]) == (new["version"], 10)
    means = [(row["trials"], row["indicator_mean"]) for row in after["rows"]]
    assert means == [(5, 250.0), (5, 0.0)]


def test_a_task_that_is_added_later_is_known_at_once(api, context, end_all) -> None:
    """Another process took the upload: this one sees it with the next question."""
    sweep(api, "support-1")
    end_all(1.0)
    assert list(board_of(api)) == ["support-1"]
    with changed(context) as other, api_client(other) as elsewhere:
        upload(elsewhere, OWN)
    assert api.get("/v1/leaderboard", params={"task": "narrow-gap"}).status_code == 200
    sweep(api, "narrow-gap")
    end_all(1.0)
    assert board_of(api, task="narrow-gap")["narrow-gap"]["unit"] == "points"
    assert list(board_of(api, level=1)) == ["support-1", "narrow-gap"]
    refused = api.get("/v1/leaderboard", params={"task": "nowhere"}).json()
    assert "narrow-gap" in refused["errors"][0]["choices"]


def test_an_own_task_takes_nobody_out_of_the_overall_ranking(api, end_all) -> None:
    upload(api, OWN)
    sweep(api, "support-1", "lift-1")
    body = {"tasks": ["narrow-gap"], "models": MODELS[:1], "samples": 5}
    api.post("/v1/sweeps", json=body)
    end_all(1.0)
    for params in ({}, {"level": 1}):
        overall = api.get("/v1/leaderboard", params=params).json()["overall"]
        assert [(row["rank"], row["missing"]) for row in overall] == [(1, []), (2, [])]
    asked = api.get("/v1/leaderboard", params={"task": ["lift-1", "narrow-gap"]}).json()["overall"]
    assert [(row["rank"], row["missing"]) for row in asked] == [(1, []), (None, ["narrow-gap"])]


def test_exports_hold_own_tasks(api, end_all) -> None:
    upload(api, OWN)
    sweep(api, "support-1", "narrow-gap")
    end_all(150.0)
    text = api.get("/v1/leaderboard/export").text
    rows = [row for row in csv.DictReader(io.StringIO(text)) if row["task"] == "narrow-gap"]
    assert {(row["indicator"], row["unit"]) for row in rows} == {("worth", "points")}
    latex = api.get("/v1/leaderboard/export", params={"format": "latex"}).text
    assert "% Measured: tasks that the paper does not have" in latex
    assert r"\multirow{2}{*}{narrow-gap}" in latex
    assert r"& builtin/expert & \textbf{7.0} & \textbf{100.0} & \textbf{150.0}" in latex
    assert api.get("/v1/leaderboard/export", params={"format": "parquet"}).status_code == 200


def test_only_its_owner_changes_a_task(guarded) -> None:
    ada, bob, reader = (new_tenant(guarded, "x", scope) for scope in ("submit", "submit", "read"))
    for who, text, status in (
        (reader, OWN, 403),
        (ada, OWN, 201),
        (bob, OTHER, 403),
        (bob, OTHER.replace("narrow-gap", "narrower-gap"), 201),
        (ada, OTHER, 201),
        (ada, OWN, 200),
    ):
        answer = who.ask("POST", "/v1/tasks", content=text.encode(), headers=YAML)
        assert answer.status_code == status, answer.text
    assert reader.ask("GET", "/v1/tasks/narrow-gap").status_code == 200
