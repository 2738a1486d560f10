"""Jobs and their files are found: sorted, filtered, and paged without losing or doubling any."""

import base64
import hashlib
import json
from collections import Counter
from itertools import product

import pytest
from support.jobs import attach, claim, execute, finish, journal_entry

from buildarena_backend.journal.journal import Usage

SORTS = ["created", "finished", "indicator", "cost"]


@pytest.fixture
def jobs(api, context, open_session) -> list[dict]:
    """Twelve jobs, some of which cost alike, score alike or never ended; one is an agent's."""
    models = ["builtin/idle", "builtin/random"]
    spec = {"tasks": ["support-1", "lift-1"], "models": models, "seeds": [0, 1, 2]}
    assert api.post("/v1/sweeps", json=spec).status_code == 201
    for number in range(8):
        lease = claim(context)
        usage = Usage(requests=1, cost_usd=[0, 1, 1, 2][number % 4])
        context.store.journal.append(lease, journal_entry(usage=usage))
        score = {"outcome": "unsuccessful", "reason": "too_weak", "flags": ["unstable", "odd"]}
        score = {"detail": f"number {number} of 100%_sure"} | (score if number < 3 else {})
        finish(context, lease, indicator=[0.1, 0.1, 7.5, -2.0][number % 4], **score)
    open_session(task="lift-1", seed=5)
    return api.get("/v1/jobs", params={"limit": 200}).json()["data"]


def pages(api, limit: int, **params: object) -> list[dict]:
    found: list[dict] = []
    cursor = None
    while True:
        given = {"limit": limit, **params, **({"cursor": cursor} if cursor else {})}
        answer = api.get("/v1/jobs", params=given)
        assert answer.status_code == 200, answer.text
        page = answer.json()
        found += page["data"]
        cursor = page["next_cursor"]
        if cursor is None:
            return found
        assert len(page["data"]) == limit


def ids(found: list[dict]) -> list[str]:
    return [job["id"] for job in found]


def value(job: dict, sort: str) -> object:
    if sort == "cost":
        return job["usage"]["cost_usd"] if job["state"] == "done" else None
    return job[{"created": "created_at", "finished": "finished_at"}.get(sort, sort)]


def test_every_order_is_kept_over_pages(api, context, jobs, monkeypatch) -> None:
    """Whether all that a filter finds are sorted, or the order's index is gone along."""
    assert len(jobs) == 13
    ended = next(job["id"] for job in jobs if job["state"] == "done")
    unpriced = 'UPDATE jobs SET model_config = \'{"provider": "external"}\' WHERE id = :id'
    execute(context, unpriced, {"id": ended})
    for sort, order, few in product(SORTS, ("asc", "desc"), (0, 40_000)):
        monkeypatch.setattr("buildarena_backend.jobs.pages.MAX_SORTED", few)
        monkeypatch.setattr("buildarena_backend.jobs.filters.MAX_SORTED", few)
        whole = pages(api, 200, sort=sort, order=order)
        assert {*ids(whole)} == {*ids(jobs)}
        values = [value(job, sort) for job in whole]
        known = [one for one in values if one is not None]
        assert values == known + [None] * (len(values) - len(known)), "what is missing is last"
        assert known == sorted(known, reverse=order == "desc")
        assert ids(pages(api, 3, sort=sort, order=order)) == ids(whole), (sort, order, few)
        for more in ({}, {"text": "lift"}):
            some = {"sort": sort, "order": order, "state": "queued", **more}
            queued = {*ids(pages(api, 200, state="queued", **more))}
            assert ids(pages(api, 2, **some)) == [one for one in ids(whole) if one in queued]


def test_filters_find_what_they_say_and_go_together(api, jobs, monkeypatch) -> None:
    def indicators(**params: object) -> list[float]:
        return sorted(job["indicator"] for job in pages(api, 3, sort="indicator", **params))

    assert indicators(min_indicator=0.1) == [0.1] * 4 + [7.5] * 2
    assert indicators(max_indicator=0.1) == [-2.0] * 2 + [0.1] * 4
    assert indicators(min_indicator=0.1, max_indicator=0.1) == [0.1] * 4
    assert indicators(min_indicator=1, max_indicator=0) == []
    (row, *_) = api.get("/v1/leaderboard").json()["tasks"][0]["rows"]
    for params, wanted in (
        ({"category": "support"}, lambda job: job["task"] == "support-1"),
        ({"category": ["support", "lift"]}, lambda _: True),
        ({"category": "mechanisms"}, lambda _: False),
        ({"reason": "too_weak"}, lambda job: job["reason"] == "too_weak"),
        ({"flag": "odd", "state": "done"}, lambda job: "odd" in (job["flags"] or ())),
        ({"outcome": "success"}, lambda job: job["outcome"] == "success"),
        ({"configuration": row["configuration"]}, lambda job: job["model"] == row["model"]),
        (
            {"task": "lift-1", "text": "idle", "state": "done", "min_indicator": 0},
            lambda job: (
                (job["task"], job["model"], job["state"]) == ("lift-1", "builtin/idle", "done")
                and job["indicator"] >= 0
            ),
        ),
        *(
            ({name: own}, lambda job, name=name, own=own: job[name] == own)
            for name in ("track", "task_version")
            for own in {job[name] for job in jobs}
        ),
    ):
        for few in (0, 40_000):
            monkeypatch.setattr("buildarena_backend.jobs.pages.MAX_SORTED", few)
            monkeypatch.setattr("buildarena_backend.jobs.filters.MAX_SORTED", few)
            found = pages(api, 4, sort="created", order="asc", **params)
            assert sorted(ids(found)) == sorted(ids(list(filter(wanted, jobs)))), params


@pytest.mark.usefixtures("jobs")
def test_texts_are_found_as_they_are_written(api) -> None:
    for text, count in (
        *(("SUPPORT", 6), ("lift-1", 7), ("agent/", 1), ("number 3", 1), ("100%_s", 8), ("%", 8)),
        *(("_", 13), ("l_ft", 0), ("n%r", 0), ("\\", 0), ("' OR 1=1 --", 0)),
    ):
        assert len(pages(api, 200, text=text)) == count, text


def test_a_summary_counts_what_the_list_shows(api, jobs) -> None:
    for wanted in ({}, {"task": "lift-1"}, {"reason": "too_weak"}, {"text": "idle"}):
        listed = pages(api, 200, **wanted)
        counted = api.get("/v1/jobs/summary", params=wanted).json()
        kinds = Counter((job["state"], job["outcome"], job["reason"]) for job in listed)
        endings = counted["endings"]
        assert {(e["state"], e["outcome"], e["reason"]): e["jobs"] for e in endings} == kinds
        assert [e["jobs"] for e in endings] == sorted((e["jobs"] for e in endings), reverse=True)
        assert (counted["jobs"], counted["all_counted"]) == (len(listed), True)
        assert counted["flags"] == Counter(flag for job in listed for flag in job["flags"] or ())
    assert jobs


def test_values_that_no_job_can_have_are_refused_with_the_choices(api, jobs) -> None:
    tracks = {job["track"] for job in jobs}
    for name, bad, choices in (
        *(("task", "lift-9", {"lift-1"}), ("model", "builtin/idel", {"builtin/idle"})),
        *(("reason", "to_weak", {"too_weak"}), ("flag", "stable", {"unstable"})),
        *(("outcome", "sucess", {"success"}), ("state", "held", {"on_hold"})),
        *(("category", "bridges", {"support"}), ("sort", "luck", {*SORTS}), ("track", "x", tracks)),
    ):
        answer = api.get("/v1/jobs", params={name: bad})
        (error,) = answer.json()["errors"]
        assert (answer.status_code, error["field"]) == (422, name)
        assert choices <= set(error["choices"])
        assert repr(bad) in error["message"]
    for name, bad in (
        *(("min_indicator", bad) for bad in ("nan", "inf", "-inf", "x", "")),
        *(("text", bad) for bad in ("", "x" * 101)),
        *(("id_prefix", bad) for bad in ("job", "job_%", "job_G", "", "job_ ", "x" * 50)),
    ):
        assert api.get("/v1/jobs", params={name: bad}).status_code == 422, (name, bad)
    assert api.get("/v1/jobs/summary", params={"reason": "luck"}).status_code == 422
    assert api.get("/v1/jobs/summary", params={"sweep": "sweep_0"}).status_code == 404
    assert api.get("/v1/sweeps", params={"id_prefix": "sweep_%"}).status_code == 422


@pytest.mark.usefixtures("jobs")
def test_cursors_of_another_order_and_forged_ones_are_refused(api) -> None:
    cursor = api.get("/v1/jobs", params={"limit": 2, "sort": "cost"}).json()["next_cursor"]
    for other in ({"sort": "finished"}, {"sort": "cost", "order": "asc"}, {}):
        answer = api.get("/v1/jobs", params={**other, "cursor": cursor})
        assert (answer.status_code, "another order" in answer.json()["detail"]) == (422, True)
    wrong = {"created": (None, "2024-01-01T00:00:00", 5), "cost": ("NaN", "x", [1])}
    wrong |= {"indicator": ("1", True), "finished": (5, {"a": 1})}
    each = [(sort, one) for sort, of in wrong.items() for one in of]
    forged = [(sort, json.dumps([sort, True, one, "job_1"])) for sort, one in each]
    shapes = ("[]", "5", "{}", '["created", true]', "[" * 500, "null", "NaN")
    texts = (*forged, *(("created", shape) for shape in shapes))
    cursors = [(sort, base64.urlsafe_b64encode(text.encode()).decode()) for sort, text in texts]
    for sort, text in (*cursors, *(("created", text) for text in ("x", "AAAA", "%00", "MjAyNg"))):
        answer = api.get("/v1/jobs", params={"sort": sort, "cursor": text})
        assert answer.status_code == 422, text
        assert answer.json()["errors"][0]["field"] == "cursor"


def test_jobs_and_sweeps_are_found_by_the_beginnings_of_their_ids(api, jobs) -> None:
    known = sorted(ids(jobs))
    for length in (4, 5, 6, 12, 24):
        prefix = known[3][:length]
        found = api.get("/v1/jobs", params={"id_prefix": prefix}).json()["data"]
        assert sorted(ids(found)) == [id_ for id_ in known if id_.startswith(prefix)]
    (sweep,) = ids(api.get("/v1/sweeps").json()["data"])
    for prefix, count in ((sweep[:20], 1), ("sweep_0000000000000", 0)):
        page = api.get("/v1/sweeps", params={"id_prefix": prefix}).json()["data"]
        assert ids(page) == [sweep] * count


def test_all_files_of_a_job_are_listed_and_given(api, context, submit_job) -> None:
    job = submit_job()
    assert api.get("/v1/jobs?reason=lost_worker").json()["data"] == [], "while no job has any"
    path = f"/v1/jobs/{job}/artifacts"
    assert api.get(path).json()["data"] == []
    assert api.get(f"{path}/machine").status_code == 404
    attach(context, job, {"machine": b"{}", "notes": b"[]"})
    files = api.get(path).json()["data"]
    assert [file["name"] for file in files] == ["machine", "notes"]
    for file in files:
        answer = api.get(f"{path}/{file['name']}")
        assert answer.headers["content-type"] == file["media_type"]
        assert answer.headers["etag"] == f'"{file["sha256"]}"'
        assert hashlib.sha256(answer.content).hexdigest() == file["sha256"]
        assert len(answer.content) == file["size"]
