"""Lists of jobs: sorted, filtered, and paged without losing or doubling any."""

import base64
import json
from collections import Counter

import pytest
from support.jobs import claim, execute, finish, journal_entry

from buildarena_store import Usage

SORTS = ["created", "finished", "indicator", "cost", "task", "model", "seed", "outcome"]


@pytest.fixture
def jobs(api, context) -> list[dict]:
    """Twelve jobs, some of which cost alike, score alike or never ended; one is an agent's."""
    spec = {
        "tasks": ["support-1", "lift-1"],
        "models": ["builtin/idle", "builtin/random"],
        "seeds": [0, 1, 2],
    }
    assert api.post("/v1/sweeps", json=spec).status_code == 202
    for number in range(8):
        lease = claim(context)
        usage = Usage(requests=1, cost_usd=[0, 1, 1, 2][number % 4])
        context.store.journal.append(lease, journal_entry(usage=usage))
        indicator = [0.1, 0.1, 7.5, -2.0][number % 4]
        finish(context, lease, indicator=indicator, detail=f"number {number} of 100%_sure")
    opened = {"task": "lift-1", "agent": "me", "seed": 5, "simulator": "mujoco"}
    assert api.post("/v1/sessions", json=opened).status_code == 201
    return api.get("/v1/jobs", params={"limit": 1000}).json()["jobs"]


def pages(api, limit: int, **params: object) -> list[dict]:
    found: list[dict] = []
    cursor = None
    while True:
        given = {"limit": limit, **params, **({"cursor": cursor} if cursor else {})}
        answer = api.get("/v1/jobs", params=given)
        assert answer.status_code == 200, answer.text
        page = answer.json()
        found += page["jobs"]
        cursor = page["next_cursor"]
        if cursor is None:
            return found
        assert len(page["jobs"]) == limit


def value(job: dict, sort: str) -> object:
    if sort == "cost":
        return job["usage"]["cost_usd"]
    return job[{"created": "created_at", "finished": "finished_at"}.get(sort, sort)]


@pytest.mark.ci
def test_every_order_is_kept_over_pages_of_every_size(api, jobs) -> None:
    assert len(jobs) == 13
    for sort in SORTS:
        for order in ("asc", "desc"):
            whole = pages(api, 1000, sort=sort, order=order)
            assert {job["id"] for job in whole} == {job["id"] for job in jobs}
            values = [value(job, sort) for job in whole]
            known = [one for one in values if one is not None]
            assert values == known + [None] * (len(values) - len(known)), "what is missing is last"
            assert known == sorted(known, reverse=order == "desc")
            for limit in (1, 3, 5):
                ids = [job["id"] for job in pages(api, limit, sort=sort, order=order)]
                assert ids == [job["id"] for job in whole], (sort, order, limit)


@pytest.mark.usefixtures("jobs")
def test_an_agents_cost_is_unknown_and_not_nothing(api) -> None:
    cheapest = pages(api, 1000, sort="cost", order="asc")
    assert cheapest[-1]["model"] == "agent/me"


@pytest.mark.usefixtures("jobs")
def test_indicators_are_filtered_by_range(api) -> None:
    def found(**params: object) -> list[float]:
        return sorted(job["indicator"] for job in pages(api, 3, sort="indicator", **params))

    assert found(indicator_min=0.1) == [0.1] * 4 + [7.5] * 2
    assert found(indicator_max=0.1) == [-2.0] * 2 + [0.1] * 4
    assert found(indicator_min=0.1, indicator_max=0.1) == [0.1] * 4
    assert found(indicator_min=8) == []
    assert found(indicator_min=1, indicator_max=0) == []


@pytest.mark.usefixtures("jobs")
def test_a_category_is_all_its_tasks(api) -> None:
    def tasks(*names: str) -> set[str]:
        return {job["task"] for job in pages(api, 4, category=list(names))}

    assert tasks("support") == {"support-1"}
    assert tasks("support", "lift") == {"support-1", "lift-1"}
    assert tasks("mechanisms") == set()
    answer = api.get("/v1/jobs", params={"category": "bridges"})
    assert answer.status_code == 422
    assert "support" in answer.json()["errors"][0]["choices"]


def test_a_summary_counts_what_the_list_shows(api, context, jobs) -> None:
    ended = [job["id"] for job in jobs if job["state"] == "done"]
    execute(
        context,
        "UPDATE jobs SET outcome = 'unsuccessful', success = false, reason = 'broke', "
        """flags = '["upside_down", "hovering"]' WHERE id = ANY(:ids)""",
        {"ids": ended[:3]},
    )
    for wanted in (
        {},
        {"task": "lift-1"},
        {"reason": "broke"},
        {"text": "idle"},
        {"state": "queued"},
    ):
        listed = pages(api, 1000, **wanted)
        counted = api.get("/v1/jobs/summary", params=wanted).json()
        kinds = Counter((job["state"], job["outcome"], job["reason"]) for job in listed)
        endings = counted["endings"]
        assert {(e["state"], e["outcome"], e["reason"]): e["jobs"] for e in endings} == kinds
        assert [e["jobs"] for e in endings] == sorted((e["jobs"] for e in endings), reverse=True)
        assert (counted["jobs"], counted["all_counted"]) == (len(listed), True)
        assert counted["flags"] == Counter(flag for job in listed for flag in job["flags"] or ())
    assert api.get("/v1/jobs/summary", params={"reason": "luck"}).status_code == 422
    assert api.get("/v1/jobs/summary", params={"sweep": "sweep_0"}).status_code == 404


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf", "x", ""])
def test_ranges_are_numbers(api, bad) -> None:
    assert api.get("/v1/jobs", params={"indicator_min": bad}).status_code == 422


@pytest.mark.nightly(keep=6)
@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("SUPPORT", 6),
        ("lift-1", 7),
        ("agent/", 1),
        ("number 3", 1),
        ("100%", 8),
        ("100%_s", 8),
        ("%", 8),
        ("_", 13),
        ("l_ft", 0),
        ("n%r", 0),
        ("\\", 0),
        ("' OR 1=1 --", 0),
    ],
)
@pytest.mark.usefixtures("jobs")
def test_texts_are_found_as_they_are_written(api, text, count) -> None:
    assert len(pages(api, 4, text=text)) == count


@pytest.mark.parametrize("text", ["", "x" * 101])
def test_texts_are_bounded(api, text) -> None:
    assert api.get("/v1/jobs", params={"text": text}).status_code == 422


def test_filters_go_together(api, jobs) -> None:
    given = {"task": "lift-1", "text": "idle", "state": "done", "indicator_min": 0}
    wanted = [
        job["id"]
        for job in jobs
        if (job["task"], job["model"], job["state"]) == ("lift-1", "builtin/idle", "done")
        and job["indicator"] >= 0
    ]
    found = pages(api, 1, sort="seed", order="asc", **given)
    assert sorted(job["id"] for job in found) == sorted(wanted)


@pytest.mark.usefixtures("jobs")
def test_a_cursor_of_another_order_is_refused(api) -> None:
    cursor = api.get("/v1/jobs", params={"limit": 2, "sort": "cost"}).json()["next_cursor"]
    for other in ({"sort": "seed"}, {"sort": "cost", "order": "asc"}, {}):
        answer = api.get("/v1/jobs", params={**other, "cursor": cursor})
        assert answer.status_code == 422
        assert "another order" in answer.json()["detail"]


@pytest.mark.nightly(keep=6)
@pytest.mark.parametrize(
    ("sort", "wrong"),
    [
        *(("created", wrong) for wrong in (None, "2024-01-01T00:00:00", 5)),
        *(("cost", wrong) for wrong in ("NaN", "x", [1])),
        *(("indicator", wrong) for wrong in ("1", True)),
        *(("seed", wrong) for wrong in (2**70, 1.5, True)),
        *(("task", wrong) for wrong in (None, 5, "a\0b")),
        ("model", {"a": 1}),
    ],
)
def test_forged_cursors_are_refused(api, sort, wrong) -> None:
    text = json.dumps([sort, True, wrong, "job_1"])
    cursor = base64.urlsafe_b64encode(text.encode()).decode()
    answer = api.get("/v1/jobs", params={"sort": sort, "cursor": cursor})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "cursor"


@pytest.mark.parametrize("text", ["[]", "5", "{}", '["created", true]', "[" * 500, "null", "NaN"])
def test_cursors_of_any_shape_are_refused(api, text) -> None:
    cursor = base64.urlsafe_b64encode(text.encode()).decode()
    assert api.get("/v1/jobs", params={"cursor": cursor}).status_code == 422


def test_an_unknown_order_names_the_choices(api) -> None:
    problem = api.get("/v1/jobs", params={"sort": "luck"}).json()
    assert problem["errors"][0]["choices"] == SORTS


def test_jobs_of_one_track_version_and_configuration_are_found(api, jobs) -> None:
    tracks = {job["track"] for job in jobs}
    assert len(tracks) == 2
    for name in ("track", "task_version"):
        for value in {job[name] for job in jobs}:
            found = pages(api, 1000, **{name: value})
            assert {job["id"] for job in found} == {j["id"] for j in jobs if j[name] == value}
    [row] = [row for task in api.get("/v1/leaderboard").json()["tasks"] for row in task["rows"]][:1]
    found = pages(api, 3, configuration=row["configuration"])
    assert {job["model"] for job in found} == {row["model"]}


@pytest.mark.usefixtures("jobs")
def test_the_jobs_of_a_row_are_just_those_it_counts(api) -> None:
    for task in api.get("/v1/leaderboard").json()["tasks"]:
        for row in task["rows"]:
            listed = api.get(f"{row['jobs']}&state=done").json()["jobs"]
            assert len(listed) == row["ended"]


def test_a_track_that_nobody_has_is_refused_with_those_there_are(api, jobs) -> None:
    answer = api.get("/v1/jobs", params={"track": "none"})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["choices"] == sorted({job["track"] for job in jobs})
