"""Leaderboards, their exports and history: ended jobs as people and programs read them."""

import csv
import io
from urllib.parse import quote

import pyarrow.parquet as pq
import pytest
from sqlalchemy import update
from support.jobs import claim, execute, finish
from support.servers.live_api import api_client, changed

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_backend.database.tables import jobs

MODELS = ["paid/expert", "paid/idle"]
YAML = {"Content-Type": "application/yaml"}
OWN = EXAMPLE.replace("{name: load, unit: mass units}", "{name: worth, unit: points}")


@pytest.fixture
def played(api, context):
    """Submits a sweep and ends its jobs: the expert's succeed, the other's do not."""

    def work(samples: int = 5, tasks=("support-1", "lift-1"), **values: object) -> list[str]:
        body = {"tasks": [*tasks], "models": MODELS, "seeds": list(range(samples))}
        assert api.post("/v1/sweeps", json=body).status_code == 201
        ended = []
        while (lease := context.store.leases.claim("construct", owner="w")) is not None:
            won = lease.job.model == "paid/expert"
            score = {"outcome": "success" if won else "unsuccessful", "metrics": {"parts": 7}}
            score["indicator"] = 100.0 if won else 0.0
            score["manifest"] = {"geometry": "1.0", "seed": lease.job.seed}
            ended.append(finish(context, lease, **{**score, **values}))
        return ended

    return work


def board(api, **params):
    answer = api.get("/v1/leaderboard", params=params)
    assert answer.status_code == 200, answer.text
    return answer.json()


def tasks_of(api, **params) -> dict[str, dict]:
    return {task["task"]: task for task in board(api, **params)["tasks"]}


def change(context, job_id: str, **values: object) -> None:
    execute(context, update(jobs).where(jobs.c.id == job_id).values(**values))


def test_an_empty_board_is_empty_in_every_form(api) -> None:
    answer = board(api)
    assert {"does_not_span", "not_driven", "unstable"} <= {f["name"] for f in answer.pop("flags")}
    lists = {"tracks": [], "tasks": [], "overall": [], "ranked": []}
    assert answer == {"track": None, "verdict": None, **lists}
    assert len(api.get("/v1/leaderboard/export").text.splitlines()) == 1
    assert "NaN" not in api.get("/v1/leaderboard/export?format=latex").text


def test_models_are_ranked_with_their_uncertainty_compared_and_filtered(api, played) -> None:
    played(10)
    answer = board(api)
    assert [task["task"] for task in answer["tasks"]] == ["support-1", "lift-1"]
    first, second = answer["tasks"][0]["rows"]
    assert (first["model"], first["rank"], first["successes"]) == ("paid/expert", 1, 10)
    assert (second["rank"], second["rank_low"], second["rank_high"]) == (2, 2, 2)
    assert (first["indicator_low"], first["indicator_high"]) == (0.0, 100.0)
    assert (first["pass_at"]["4"], first["baseline"]) == (1.0, False)
    best, _ = answer["overall"]
    assert (best["model"], best["rank"], best["mean_rank"]) == ("paid/expert", 1, 1.0)
    for task in answer["tasks"]:
        for row in task["rows"]:
            listed = api.get(row["jobs"]).json()["data"]
            assert {job["model"] for job in listed} == {row["model"]}
            assert len(listed) == row["ended"]
    assert [*tasks_of(api, task="lift-1")] == ["lift-1"]
    (row,) = tasks_of(api, model="paid/idle", task="lift-1")["lift-1"]["rows"]
    assert (row["model"], row["rank"], row["baseline"]) == ("paid/idle", 1, False)
    # Names of tracks have pluses, which a URL means as spaces.
    (track,) = answer["tracks"]
    assert "+" in track
    for path in ("/v1/leaderboard", "/v1/jobs"):
        whole, written = (api.get(f"{path}?track={name}") for name in (quote(track), track))
        assert whole.json() == written.json()

    pair = {"first": "paid/expert", "second": "paid/idle"}
    compared = api.get("/v1/leaderboard/compare", params=pair).json()
    task = compared["tasks"][0]
    assert (task["successes"], task["counted_jobs"], task["better"]) == ([10, 0], [10, 10], "first")
    assert compared["sentence"].startswith("paid/expert is best on these")
    assert compared["better"] == "first"
    itself = api.get("/v1/leaderboard/compare", params={**pair, "second": "paid/expert"})
    assert (itself.status_code, itself.json()["errors"][0]["field"]) == (422, "second")
    unknown = api.get("/v1/leaderboard/compare", params={**pair, "second": "x"})
    assert (unknown.status_code, "paid/idle@" in unknown.text) == (422, True)


def test_filters_that_name_nothing_are_refused_with_the_choices(api) -> None:
    for field, value, choice in (
        ("task", "x", "lift-1"),
        ("category", "garage", "flight"),
        ("model", "paid/expret", None),
        ("since", "2026-01-02T00:00:00", None),
    ):
        answer = api.get("/v1/leaderboard", params={field: value})
        (error,) = answer.json()["errors"]
        assert (answer.status_code, error["field"]) == (422, field)
        assert choice is None or choice in error["choices"]
    for route in ("", "/export"):
        answer = api.get(f"/v1/leaderboard{route}?sweep=sweep_{'0' * 20}")
        assert (answer.status_code, "sweep_" in answer.json()["detail"]) == (404, True)


def test_flags_disqualify_or_mark_what_is_at_least_its_figure(api, played) -> None:
    played(2, tasks=("support-1",), flags=["no_wheels"])
    ids = played(2, tasks=("support-3",), flags=["never_fell"], indicator=1500.0)
    found = tasks_of(api)
    row = next(r for r in found["support-1"]["rows"] if r["model"] == "paid/expert")
    assert (row["flagged"], row["flags"]) == (2, {"no_wheels": 2})
    assert (row["counted"], row["successes"], row["indicator_mean"]) == (2, 0, 0.0)
    assert (row["too_few_data"], row["indicator_low"]) == (True, None)
    row = next(r for r in found["support-3"]["rows"] if r["model"] == "paid/expert")
    assert (row["successes"], row["censored"], row["indicator_best"]) == (2, 2, 1500.0)
    assert {api.get(f"/v1/jobs/{id_}").json()["censored"] for id_ in ids} == {True}
    pair = {"first": "paid/expert", "second": "paid/idle", "task": "support-1"}
    compared = api.get("/v1/leaderboard/compare", params=pair).json()
    assert compared["tasks"][0]["successes"] == [0, 0]
    flags = {flag["name"]: flag["disqualifying"] for flag in board(api)["flags"]}
    assert (flags["never_fell"], flags["unstable"]) == (False, True)


def test_throws_stand_by_their_distance(api, context) -> None:
    sweep = {"tasks": ["throw-1"], "models": ["paid/expert"], "seeds": [0, 1]}
    assert api.post("/v1/sweeps", json={"name": "throws", **sweep}).status_code == 201
    for parabola in (120.0, None):
        metrics = {"parts": 7, "parabola": parabola}
        finish(context, claim(context), "success", 50.0, metrics=metrics)
    task = tasks_of(api, task="throw-1")["throw-1"]
    row = task["rows"][0]
    assert (task["indicator"], task["unit"]) == ("distance", "units")
    assert (row["indicator_mean"], row["score"] is None) == (50.0, False)


def test_a_reader_who_has_the_answer_gets_none_until_something_changes(api, context, played):
    ids = played(1)
    first = api.get("/v1/leaderboard")
    tag = {"If-None-Match": first.headers["etag"]}
    assert api.get("/v1/leaderboard", headers=tag).status_code == 304
    change(context, ids.pop(), indicator=55.0, success=0.0, outcome="limit")
    again = api.get("/v1/leaderboard", headers=tag)
    assert again.status_code == 200
    assert again.headers["etag"] != first.headers["etag"]


def test_all_or_a_sample_of_a_models_results_are_verified(api, context, played) -> None:
    played()
    body = {"model": "paid/expert", "sample": 3}
    accepted, again = (api.post("/v1/leaderboard/verify", json=body).json() for _ in range(2))
    assert (accepted["scored"], len(accepted["verification_ids"])) == (10, 3)
    checks = context.store.verifications
    told = [found["verification_ids"] for found in (accepted, again)]
    first, second = ({checks.get(id_).job_id for id_ in ids} for ids in told)
    assert first == second
    everything = api.post("/v1/leaderboard/verify", json={"model": "paid/expert"}).json()
    assert len(everything["verification_ids"]) == 10


def test_a_board_of_some_sweeps_holds_their_jobs_alone(api, played) -> None:
    played()
    small = {"tasks": ["support-1"], "models": MODELS, "seeds": [0, 1]}
    other = {**small, "models": ["paid/expert"], "seeds": [7]}
    shared, own = (api.post("/v1/sweeps", json=spec).json()["id"] for spec in (small, other))
    found = board(api, sweep=shared)
    (task,) = found["tasks"]
    rows = {row["model"]: row["ended"] for row in task["rows"]}
    assert rows == {"paid/expert": 2, "paid/idle": 2}
    assert [row["counted"] for row in found["overall"]] == [2, 2]
    assert board(api, sweep=[shared, own]) == found
    assert board(api, sweep=own)["track"] is None, "nothing of the other one has ended"


def test_without_a_track_the_standard_one_is_shown_in_each_form(api, context, played) -> None:
    for id_ in played(2, tasks=("support-1",)):
        change(context, id_, track="most/track")
    (sweep,) = api.get("/v1/sweeps").json()["data"]
    standard = context.store.jobs.get(played(1, tasks=("lift-1",))[0]).track
    pair = {"first": "paid/expert", "second": "paid/idle"}
    for route, asked in (("", {}), ("/compare", pair)):
        found = api.get(f"/v1/leaderboard{route}", params=asked).json()
        assert found["track"] == standard
    assert f"% Track: {standard}" in api.get("/v1/leaderboard/export?format=latex").text
    assert board(api, sweep=sweep["id"])["track"] == "most/track"


def test_own_tasks_stand_beside_built_in_ones_and_versions_do_not_mix(api, context, played) -> None:
    def upload(client, text: str) -> dict:
        answer = client.post("/v1/tasks", content=text.encode(), headers=YAML)
        assert answer.status_code == 201, answer.text
        return answer.json()

    played()
    assert [*tasks_of(api)] == ["support-1", "lift-1"]
    # Another process takes the upload: this one sees it with the next question.
    with changed(context) as other, api_client(other) as elsewhere:
        old = upload(elsewhere, OWN)
    assert tasks_of(api, task="narrow-gap") == {}
    assert "narrow-gap" in api.get("/v1/leaderboard?task=nowhere").json()["errors"][0]["choices"]
    played(2, tasks=("narrow-gap",), indicator=150.0)
    found = tasks_of(api)
    assert [*found] == ["support-1", "lift-1", "narrow-gap"]
    own = found["narrow-gap"]
    assert (own["custom"], own["indicator"], own["unit"]) == (True, "worth", "points")
    assert (own["version"], found["lift-1"]["custom"]) == (old["version"], False)
    new = upload(api, OWN.replace("final_mass: 200", "final_mass: 300"))
    # Until the new version has results, the old one's are shown under its own name.
    assert tasks_of(api)["narrow-gap"]["version"] == old["version"]
    played(3, tasks=("narrow-gap",), indicator=250.0)
    after = tasks_of(api)["narrow-gap"]
    assert (after["version"], after["outdated"]) == (new["version"], 4)
    means = [(row["counted"], row["indicator_mean"]) for row in after["rows"]]
    assert means == [(3, 250.0), (3, 0.0)]
    # It takes nobody out of the overall ranking.
    gone = update(jobs).where(jobs.c.task == "narrow-gap", jobs.c.model == "paid/idle")
    execute(context, gone.values(state="queued", outcome=None, success=None, indicator=None))
    overall = board(api)["overall"]
    assert [(row["rank"], row["missing"]) for row in overall] == [(1, []), (2, [])]
    asked = board(api, task=["lift-1", "narrow-gap"])["overall"]
    assert [(row["rank"], row["missing"]) for row in asked] == [(1, []), (2, ["narrow-gap"])]


def test_exports_hold_the_same_rows_in_each_format(api, played) -> None:
    assert api.post("/v1/tasks", content=OWN.encode(), headers=YAML).status_code == 201
    played(4, tasks=("support-1", "narrow-gap"))

    def exported(kind: str) -> bytes:
        return api.get("/v1/leaderboard/export", params={"format": kind}).content

    rows = list(csv.DictReader(io.StringIO(exported("csv").decode())))
    table = pq.read_table(io.BytesIO(exported("parquet"))).to_pylist()
    assert len(rows) == len(table) == 4
    for words, typed in zip(rows, table, strict=True):
        assert list(words) == list(typed)
        assert list(typed)[:4] == ["task", "model", "track", "task_version"]
        told = (typed["model"], str(typed["success_rate"]))
        assert (words["model"], words["success_rate"]) == told
    assert {row["unit"] for row in rows if row["task"] == "narrow-gap"} == {"points"}
    latex = exported("latex").decode()
    assert r"& GPT-5 & \textbf{40.1} & -- & -- & \textbf{85.9}" in latex
    assert "% Measured: tasks that the paper does not have" in latex
    assert r"\multirow{2}{*}{narrow-gap}" in latex
    assert r"& paid/expert & \textbf{7.0} & \textbf{100.0} & \textbf{100.0}" in latex
