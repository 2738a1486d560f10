"""Metrics of a board as data: the page and the report never differ."""

import pytest
from support.jobs import claim, execute, finish, journal_entry

from buildarena_benchmark.flags import ScoringPolicy
from buildarena_benchmark.leaderboard import EndedJob, cost_bins, failure_rows
from buildarena_store import TrialFilter, Usage


def end_next(context, outcome: str, indicator: float, tokens: int, **more: object) -> None:
    lease = claim(context)
    usage = Usage(requests=1, output_tokens=tokens, cost_usd=1)
    context.store.journal.append(lease, journal_entry(usage=usage))
    counts = {"actions": 10, "refused_actions": 3, "refusals": {"overlap": 3}}
    finish(context, lease, outcome, indicator, columns=counts, **more)


@pytest.fixture
def played(api, context) -> None:
    spec = {"tasks": ["support-1"], "models": ["builtin/idle", "builtin/random"], "seeds": [0, 1]}
    assert api.post("/v1/sweeps", json=spec).status_code == 202
    end_next(context, "success", 100.0, 50)
    end_next(context, "construction_failed", 0.0, 10, reason="objection")
    end_next(context, "success", 50.0, 1000, flags=("unstable",))
    end_next(context, "unsuccessful", 25.0, 400)


def test_figures_without_jobs_are_empty(api) -> None:
    found = api.get("/v1/leaderboard/figures").json()
    assert found["track"] is None
    assert found["failures"] == found["cost"] == found["front"] == found["dimensions"] == []


@pytest.mark.usefixtures("played")
def test_figures_are_those_of_the_trials(api, context) -> None:
    answer = api.get("/v1/leaderboard/figures")
    found = answer.json()
    trials: list[EndedJob] = context.store.results.boards.trials(TrialFilter())
    wanted = {
        row.model: (dict(row.outcomes), dict(row.refusals), row.actions, row.refused_actions)
        for row in failure_rows(trials)
    }
    assert wanted == {
        row["model"]: (row["outcomes"], row["refusals"], row["actions"], row["refused_actions"])
        for row in found["failures"]
    }
    assert sum(sum(row["outcomes"].values()) for row in found["failures"]) == 4
    assert any("construction_failed: objection" in row["outcomes"] for row in found["failures"])
    (cost,) = found["cost"]
    categories = {"support-1": cost["category"]}
    bins = cost_bins(trials, policy=ScoringPolicy.OURS, categories=categories)[cost["category"]]
    assert [one["trials"] for one in cost["bins"]] == [one.trials for one in bins]
    assert [one["mean"] for one in cost["bins"]] == [one.mean for one in bins]
    board = api.get("/v1/leaderboard").json()
    for name in ("mean_rank", "cost_usd_mean", "success_rate_mean", "pareto"):
        assert [row[name] for row in found["front"]] == [row[name] for row in board["overall"]]
    ranked = [row["model"] for row in board["overall"] if row["rank"] is not None]
    assert [row["model"] for row in found["dimensions"]] == ranked
    scores = [score for row in found["dimensions"] for score in row["dimensions"].values()]
    assert all(0 <= score <= 1 for score in scores)
    assert any(row["pareto"] for row in found["front"])
    known = {"If-None-Match": answer.headers["etag"]}
    again = api.get("/v1/leaderboard/figures", headers=known)
    assert again.status_code == 304


@pytest.mark.usefixtures("played")
def test_figures_follow_what_changed_and_what_is_chosen(api, context) -> None:
    def models() -> list[str]:
        given = {"model": "builtin/idle"}
        rows = api.get("/v1/leaderboard/figures", params=given).json()["failures"]
        return [row["model"] for row in rows]

    assert models() == ["builtin/idle"]
    execute(context, "UPDATE jobs SET outcome = 'cancelled' WHERE model = 'builtin/idle'")
    rows = api.get("/v1/leaderboard/figures").json()["failures"]
    idle = next(row for row in rows if row["model"] == "builtin/idle")
    assert next(iter(idle["outcomes"])).startswith("cancelled")


@pytest.mark.parametrize("bad", [{"track": "x"}, {"task": "x"}])
def test_unknown_choices_are_refused(api, bad) -> None:
    assert api.get("/v1/leaderboard/figures", params=bad).status_code == 422
