import json
from datetime import UTC, datetime, timedelta
from urllib.parse import quote

import pytest
from sqlalchemy import delete, text, update
from support.jobs import claim, execute, finish
from support.servers.live_api import api_client

from buildarena_store.tables import jobs

SWEEP = {
    "tasks": ["support-1", "lift-1"],
    "models": ["builtin/expert", "builtin/random"],
}


@pytest.fixture
def played(api, context):
    """Submits the sweep and ends its jobs: the expert's succeed, the other's do not."""

    def work(count: int = 20, *, samples: int = 5, **values: object) -> list[str]:
        api.post("/v1/sweeps", json={**SWEEP, "seeds": list(range(samples))})
        ended = []
        for _ in range(count):
            lease = claim(context)
            won = lease.job.model == "builtin/expert"
            score = {
                "outcome": "success" if won else "unsuccessful",
                "indicator": 100.0 if won else 0.0,
                "metrics": {"parts": 7},
                "manifest": {"geometry": "1.0", "seed": lease.job.seed},
            }
            ended.append(finish(context, lease, **{**score, **values}))
        return ended

    return work


def board(api, **params):
    return api.get("/v1/leaderboard", params=params).json()


def change(context, job_id: str, why: str | None = None, **values: object) -> None:
    with context.store.database.transaction() as connection:
        if why is not None:
            connection.execute(
                text("SELECT set_config('buildarena.why', :why, true)"), {"why": why}
            )
        connection.execute(update(jobs).where(jobs.c.id == job_id).values(**values))


def test_models_are_ranked_on_tasks_and_overall_with_their_uncertainty(api, played) -> None:
    played(40, samples=10)
    answer = board(api)
    assert [task["task"] for task in answer["tasks"]] == ["support-1", "lift-1"]
    first, second = answer["tasks"][0]["rows"]
    assert (first["model"], first["rank"], first["successes"]) == ("builtin/expert", 1, 10)
    assert (second["rank"], second["rank_low"], second["rank_high"]) == (2, 2, 2)
    assert (first["indicator_low"], first["indicator_high"]) == (0.0, 100.0)
    assert first["pass_at"]["4"] == 1.0
    best, _ = answer["overall"]
    assert (best["model"], best["rank"]) == ("builtin/expert", 1)
    assert (best["mean_rank"], best["pareto"]) == (1.0, True)
    listed = api.get(first["jobs"]).json()["jobs"]
    assert {job["model"] for job in listed} == {"builtin/expert"}


def test_filters_choose_tasks_levels_models_and_time(api, played) -> None:
    played()
    assert [t["task"] for t in board(api, task="lift-1")["tasks"]] == ["lift-1"]
    assert board(api, level=2)["tasks"] == []
    assert {t["task"] for t in board(api, level=[1, 2])["tasks"]} == {"lift-1", "support-1"}
    (row,) = board(api, model="builtin/random", task="lift-1")["tasks"][0]["rows"]
    assert (row["model"], row["rank"]) == ("builtin/random", 1)
    soon = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    assert board(api, since=soon)["tasks"] == []
    assert len(board(api, until=soon)["tasks"]) == 2


@pytest.mark.parametrize(
    ("params", "field"),
    [
        ({"level": 99}, "level"),
        ({"task": "x"}, "task"),
        ({"since": "2026-01-01T00:00:00"}, "since"),
    ],
)
def test_filters_that_name_nothing_are_refused(api, params, field) -> None:
    answer = api.get("/v1/leaderboard", params=params)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, field)


def expert_of(answer) -> dict:
    rows = answer["tasks"][0]["rows"]
    return next(row for row in rows if row["model"] == "builtin/expert")


def test_a_disqualified_trial_counts_as_a_failure(api, played) -> None:
    played(10, flags=["no_wheels"])
    row = expert_of(board(api, task="support-1"))
    assert (row["flagged"], row["flags"]) == (5, {"no_wheels": 5})
    assert (row["trials"], row["successes"], row["indicator_mean"]) == (5, 0, 0.0)


def test_throws_stand_by_their_distance(api, context) -> None:
    sweep = {"tasks": ["throw-1"], "models": ["builtin/expert"], "seeds": [0, 1]}
    assert api.post("/v1/sweeps", json={"name": "throws", **sweep}).status_code == 202
    for parabola in (120.0, None):
        metrics = {"parts": 7, "parabola": parabola, "robustness": 1.0, "robust_indicator": 50.0}
        finish(context, claim(context), "success", 55.0, metrics=metrics)
    before = (datetime.now(UTC) - timedelta(hours=1)).isoformat()
    for period in ({}, {"since": before}):
        (task,) = board(api, task="throw-1", **period)["tasks"]
        row = task["rows"][0]
        assert (task["indicator"], task["unit"]) == ("distance", "units")
        assert (row["indicator_mean"], row["score"] is None) == (50.0, False)


@pytest.mark.parametrize("name", ["since", "until"])
def test_a_time_without_a_zone_is_refused(api, name) -> None:
    answer = api.get("/v1/leaderboard", params={name: "2026-01-02T00:00:00"})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == name


def test_a_bridge_that_carries_everything_is_shown_as_at_least_its_load(api, played) -> None:
    ids = played(10, flags=["never_fell"], indicator=1500.0)
    row = expert_of(board(api, task="support-1"))
    assert (row["successes"], row["censored"], row["indicator_best"]) == (5, 5, 1500.0)
    assert {api.get(f"/v1/jobs/{id_}").json()["censored"] for id_ in ids} == {True}
    flags = {flag["name"]: flag for flag in board(api)["flags"]}
    assert flags["never_fell"]["disqualifying"] is False
    assert flags["unstable"]["disqualifying"] is True
    assert all(flag["meaning"].endswith(".") for flag in flags.values())


@pytest.mark.parametrize("path", ["/v1/leaderboard", "/v1/jobs"])
def test_a_track_is_found_by_its_name_as_it_stands(api, played, path) -> None:
    """Names have pluses, which a URL means as spaces."""
    played()
    (track,) = board(api)["tracks"]
    assert "+" in track
    whole, written = (api.get(f"{path}?track={name}") for name in (quote(track), track))
    assert (whole.status_code, written.status_code) == (200, 200)
    assert whole.json() == written.json()
    assert api.get(f"{path}?track=no+such").status_code == 422


def test_too_few_successes_are_said_to_be_too_few(api, played) -> None:
    played()
    for row in board(api, task="support-1")["tasks"][0]["rows"]:
        assert row["too_few_data"] is True
        assert (row["indicator_low"], row["indicator_high"]) == (None, None)


def test_a_comparison_counts_disqualified_trials_as_failures(api, played) -> None:
    played(flags=["start_too_high"])
    pair = {"first": "builtin/expert", "second": "builtin/random"}
    answer = api.get("/v1/leaderboard/compare", params=pair).json()
    assert answer["tasks"][0]["successes"] == [0, 0]


def test_a_reader_who_has_the_answer_gets_none_until_something_changes(api, context, played):
    ids = played()
    first = api.get("/v1/leaderboard")
    tag = {"If-None-Match": first.headers["etag"]}
    assert api.get("/v1/leaderboard", headers=tag).status_code == 304
    change(context, ids[0], indicator=55.0, success=False, outcome="unsuccessful")
    again = api.get("/v1/leaderboard", headers=tag)
    assert again.status_code == 200
    assert again.headers["etag"] != first.headers["etag"]


@pytest.mark.ci
def test_a_board_kept_up_to_date_equals_one_that_is_made_anew(api, context, played) -> None:
    def fresh() -> bytes:
        with api_client(context) as other:
            return other.get("/v1/leaderboard").content

    ids = played(7)
    assert api.get("/v1/leaderboard").content == fresh()
    api.get("/v1/leaderboard")
    change(context, ids[0], success=False, outcome="limit", indicator=0.0)
    assert api.get("/v1/leaderboard").content == fresh()
    change(context, ids[1], state="queued", outcome=None, success=None, indicator=None)
    execute(context, delete(jobs).where(jobs.c.id == "nobody"))
    assert api.get("/v1/leaderboard").content == fresh()
    played(6)
    assert api.get("/v1/leaderboard").content == fresh()


def test_a_change_that_was_not_yet_committed_is_seen_later(api, context, played) -> None:
    """Ids and transactions become visible out of order; no change may be lost by that."""
    ids = played(6)
    slow = context.store.database.engine.connect()
    slow.execute(update(jobs).where(jobs.c.id == ids[0]).values(indicator=999.0))
    change(context, ids[1], indicator=55.0)
    board(api)
    slow.commit()
    slow.close()
    assert api.get(f"/v1/jobs/{ids[0]}").json()["indicator"] == 999.0
    means = [r["indicator_mean"] for t in board(api)["tasks"] for r in t["rows"]]
    assert max(means) > 200


def test_the_change_log_tells_what_entered_left_and_was_rescored(api, context, played) -> None:
    ids = played(3)
    change(context, ids[0], why="the scorer was wrong", indicator=55.0)
    change(context, ids[1], state="queued", outcome=None, success=None, indicator=None)
    log = api.get("/v1/leaderboard/changes").json()
    kinds = [(entry["kind"], entry["job_id"]) for entry in log["changes"]]
    assert kinds == [
        ("left", ids[1]),
        ("rescored", ids[0]),
        *(("entered", id_) for id_ in reversed(ids)),
    ]
    rescored = log["changes"][1]
    assert rescored["why"] == "the scorer was wrong"
    assert rescored["after"]["indicator"] == 55.0
    page = api.get("/v1/leaderboard/changes", params={"limit": 2}).json()
    rest = api.get("/v1/leaderboard/changes", params={"before": page["next_before"]}).json()
    assert page["changes"] + rest["changes"] == log["changes"]


def test_an_errored_job_is_in_the_log_only_when_asked_for(api, context, sweep) -> None:
    api.post("/v1/sweeps", json=sweep)
    context.store.leases.give_up(claim(context), "gone", reason="lost_worker")
    assert api.get("/v1/leaderboard/changes").json()["changes"] == []
    (entry,) = api.get("/v1/leaderboard/changes", params={"unscored": True}).json()["changes"]
    assert (entry["kind"], entry["after"]["reason"]) == ("unscored", "lost_worker")


def test_two_models_are_compared_in_pairs_of_shared_seeds(api, played) -> None:
    played()
    pair = {"first": "builtin/expert", "second": "builtin/random"}
    answer = api.get("/v1/leaderboard/compare", params=pair).json()
    task = answer["tasks"][0]
    assert (task["successes"], task["trials"], task["success"]["pairs"]) == ([5, 0], [5, 5], 5)
    assert task["success"]["p_value"] == pytest.approx(2 / 32)
    assert task["success_p"] == pytest.approx(4 / 32)
    unknown = api.get("/v1/leaderboard/compare", params={**pair, "second": "x"})
    assert unknown.status_code == 422
    assert "builtin/random@" in unknown.text


def test_a_manifest_tells_the_versions_behind_an_entry(api, played) -> None:
    played()
    row = board(api)["tasks"][0]["rows"][0]
    entries = {entry["name"]: entry for entry in api.get(row["manifest"]).json()}
    assert entries["geometry"]["values"] == [{"value": "1.0", "jobs": 5}]
    assert entries["seed"]["distinct"] == 5


def test_all_or_a_sample_of_a_models_results_are_verified(api, context, played) -> None:
    played()
    body = {"model": "builtin/expert", "sample": 3}
    accepted = api.post("/v1/leaderboard/verify", json=body).json()
    assert (accepted["scored"], len(accepted["verifications"])) == (10, 3)
    again = api.post("/v1/leaderboard/verify", json=body).json()
    first, second = (
        {context.store.verifications.get(id_).job_id for id_ in found["verifications"]}
        for found in (accepted, again)
    )
    assert first == second
    everything = api.post("/v1/leaderboard/verify", json={"model": "builtin/expert"}).json()
    assert len(everything["verifications"]) == 10
    assert api.post("/v1/leaderboard/verify", json={"model": "x"}).status_code == 422


def test_a_sweeps_results_have_their_rounds(api, played) -> None:
    played()
    sweep_id = api.get("/v1/sweeps").json()["sweeps"][0]["id"]
    results = api.get(f"/v1/sweeps/{sweep_id}/results").json()
    assert len(results) == 20
    assert results[0]["rounds"] == []
    assert json.dumps(results).count("NaN") == 0
    assert api.get("/v1/sweeps/sweep_x/results").status_code == 404


def test_a_board_of_some_sweeps_holds_their_jobs_alone(api, played) -> None:
    played()
    small = {**SWEEP, "tasks": ["support-1"], "seeds": [0, 1]}
    other = {**SWEEP, "tasks": ["support-1"], "models": ["builtin/expert"], "seeds": [7]}
    shared, own = (api.post("/v1/sweeps", json=spec).json()["id"] for spec in (small, other))
    found = board(api, sweep=shared)
    assert [task["task"] for task in found["tasks"]] == ["support-1"]
    rows = {row["model"]: row["ended"] for row in found["tasks"][0]["rows"]}
    assert rows == {"builtin/expert": 2, "builtin/random": 2}
    assert [row["trials"] for row in found["overall"]] == [2, 2]
    assert board(api, sweep=[shared, own]) == found
    # Nothing of the other one has ended, so it has no track and no board.
    assert board(api, sweep=own)["track"] is None
    asked = api.get("/v1/leaderboard", params={"sweep": own, "track": found["track"]})
    assert asked.status_code == 422
    figures = api.get("/v1/leaderboard/figures", params={"sweep": shared}).json()
    assert sum(sum(row["outcomes"].values()) for row in figures["failures"]) == 4
    assert len(board(api)["tasks"]) == 2


@pytest.mark.parametrize("route", ["", "/figures", "/export?format=csv"])
def test_a_board_of_an_unknown_sweep_is_refused(api, played, route) -> None:
    played(1)
    joint = "&" if "?" in route else "?"
    answer = api.get(f"/v1/leaderboard{route}{joint}sweep=sweep_{'0' * 20}")
    assert answer.status_code == 404
    assert "sweep_" in answer.json()["detail"]
