"""Answers as frames of both libraries."""

import json
from datetime import UTC, datetime

import pandas as pd
import polars as pl
import pytest

from buildarena_client import (
    BadArgumentError,
    Client,
    jobs_frame,
    leaderboard_frame,
    results_frame,
    sweeps_frame,
)

pytestmark = pytest.mark.ci

USAGE = {
    **dict.fromkeys(("cached_tokens", "input_tokens", "output_tokens", "reasoning_tokens")),
    "requests": 3,
    "cost_usd": None,
}
JOB = {
    "id": "job_1",
    "task": "lift-1",
    "seed": 2**62,
    "success": None,
    "indicator": None,
    "censored": False,
    "by_runner": False,
    **dict.fromkeys(("actions", "faults", "refused_actions"), 0),
    "flags": None,
    "metrics": None,
    "refusals": None,
    "created_at": "2026-03-01T12:00:00.250000+02:00",
    "finished_at": None,
    "usage": USAGE,
}
DONE = {
    **JOB,
    "id": "job_2",
    "success": True,
    "indicator": 4,
    "flags": ["unstable", "odd"],
    "metrics": {"load": 3, "span": True, "name": "x", "peaks": [1, 2]},
    "refusals": {"collision": 2},
    "finished_at": "2026-03-01T11:00:00Z",
    "usage": {**USAGE, "input_tokens": 12, "cost_usd": 0.5},
}
TIME = datetime(2026, 3, 1, 10, 0, 0, 250_000, tzinfo=UTC)


def test_types_and_what_is_missing_in_pandas() -> None:
    frame = jobs_frame([JOB, DONE])
    assert {name: str(frame[name].dtype) for name in TYPES} == TYPES
    assert frame["created_at"][0] == pd.Timestamp(TIME)
    assert frame["seed"].tolist() == [2**62, 2**62]
    missing = frame.iloc[0][[*("success", "indicator", "flags", "finished_at", "usage.cost_usd")]]
    assert missing.isna().all()
    assert frame["metrics.load"].isna().tolist() == [True, False]
    assert frame["flags"][1] == ["unstable", "odd"]
    assert json.loads(frame["metrics.peaks"][1]) == [1, 2]
    assert frame["usage.input_tokens"].sum() == 12
    assert frame["indicator"].mean() == 4.0


TYPES = {
    "id": "string",
    "seed": "int64",
    "success": "boolean",
    "censored": "bool",
    "indicator": "float64",
    "created_at": "datetime64[us, UTC]",
    "finished_at": "datetime64[us, UTC]",
    "usage.input_tokens": "Int64",
    "usage.cost_usd": "float64",
    "metrics.load": "Int64",
    "metrics.span": "boolean",
    "metrics.name": "string",
    "refusals.collision": "Int64",
    "flags": "object",
}


def test_types_and_what_is_missing_in_polars() -> None:
    frame = jobs_frame([JOB, DONE], kind="polars")
    expected = {
        "id": pl.String,
        "seed": pl.Int64,
        "success": pl.Boolean,
        "indicator": pl.Float64,
        "created_at": pl.Datetime("us", "UTC"),
        "flags": pl.List(pl.String),
        "usage.cost_usd": pl.Float64,
        "metrics.load": pl.Int64,
    }
    assert {name: frame.schema[name] for name in expected} == expected
    assert frame["created_at"][0] == TIME
    first = frame.row(0, named=True)
    assert [first[name] for name in ("success", "flags", "finished_at", "metrics.load")] == [
        None
    ] * 4
    assert frame["flags"][1].to_list() == ["unstable", "odd"]


@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_a_frame_without_rows_has_its_columns(kind) -> None:
    empty, full = jobs_frame([], kind=kind), jobs_frame([JOB], kind=kind)
    assert len(empty) == 0
    assert list(empty.columns) == list(full.columns)
    assert [str(one) for one in empty.dtypes] == [str(one) for one in full.dtypes]
    for make in (sweeps_frame, results_frame):
        assert len(make([], kind=kind)) == 0
    board = {"track": None, "tracks": [], "tasks": []}
    columns = list(leaderboard_frame(board, kind=kind).columns)
    assert columns[:2] == ["task", "model"]
    assert "success_rate" in columns
    assert "mean_rank" in leaderboard_frame(board, overall=True, kind=kind).columns


def test_what_an_older_service_does_not_say_is_missing() -> None:
    older = {name: value for name, value in JOB.items() if name not in {"faults", "censored"}}
    frame = jobs_frame([older, JOB])
    assert frame["faults"].isna().tolist() == frame["censored"].isna().tolist() == [True, False]


def test_a_kind_that_is_none_is_refused_with_the_choices() -> None:
    with pytest.raises(BadArgumentError, match="choose from pandas, polars"):
        jobs_frame([], kind="os")


def test_a_field_that_a_newer_service_adds_does_no_harm() -> None:
    newer = {**JOB, "novelty": {"a": 1}, "usage": {**USAGE, "novelty": 1}}
    assert list(jobs_frame([newer]).columns) == list(jobs_frame([JOB]).columns)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_a_services_answers_as_frames(service, kind) -> None:
    client = Client(service.url)
    jobs = jobs_frame(client.jobs(), kind=kind)
    assert sorted(jobs["id"].to_list()) == sorted(service.jobs)
    assert sum(jobs["success"].to_list()) == 3
    assert any(name.startswith("metrics.") for name in jobs.columns)
    board = leaderboard_frame(client.leaderboard(), kind=kind)
    assert board["model"].to_list() == ["builtin/expert", "builtin/idle"]
    assert board["task"].to_list() == ["lift-1", "lift-1"]
    assert board["success_rate"].to_list() == [1.0, 0.0]
    sweeps = sweeps_frame(client.sweeps(), kind=kind)
    assert sweeps["progress.done"].to_list() == [6]
    assert "spec.tasks" in sweeps.columns
    results = results_frame(client.sweep_results(service.sweep), kind=kind)
    assert len(results) == 6
    overall = leaderboard_frame(client.leaderboard(), overall=True, kind=kind)
    assert len(overall) in {0, 2}


@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_columns_stand_in_the_order_in_which_people_read(kind) -> None:
    columns = list(jobs_frame([], kind=kind).columns)
    assert columns[:7] == ["id", "task", "model", "seed", "outcome", "success", "indicator"]
    assert len(columns) == len(set(columns))
    assert list(sweeps_frame([], kind=kind).columns)[:2] == ["id", "name"]
    assert list(results_frame([], kind=kind).columns)[1:4] == ["task", "model", "seed"]
