"""Answers as frames of both libraries."""

import json
from datetime import UTC, datetime

import pandas as pd
import polars as pl
import pytest

from buildarena_client import (
    BadArgumentError,
    jobs_frame,
    leaderboard_frame,
    results_frame,
    sweeps_frame,
)

pytestmark = pytest.mark.ci

UNKNOWN = ("cached_tokens", "input_tokens", "output_tokens", "reasoning_tokens")
USAGE = {**dict.fromkeys(UNKNOWN), "requests": 3, "cost_usd": None}
NONE = ("success", "indicator", "flags", "metrics", "refusals", "finished_at")
JOB = {**dict.fromkeys(NONE), **dict.fromkeys(("actions", "faults", "refused_actions"), 0)}
JOB |= {"id": "job_1", "task": "lift-1", "seed": 2**62, "usage": USAGE}
JOB |= {"censored": False, "ran_on_runner": False}
JOB["created_at"] = "2026-03-01T12:00:00.250000+02:00"
DONE = {
    **JOB,
    "id": "job_2",
    "success": 1.0,
    "indicator": 4,
    "flags": ["unstable", "odd"],
    "metrics": {"load": 3, "span": True, "name": "x", "peaks": [1, 2]},
    "refusals": {"collision": 2},
    "finished_at": "2026-03-01T11:00:00Z",
    "usage": {**USAGE, "input_tokens": 12, "cost_usd": 0.5},
}
TIME = datetime(2026, 3, 1, 10, 0, 0, 250_000, tzinfo=UTC)


TYPES = {"id": ("string", pl.String), "seed": ("int64", pl.Int64)}
TYPES |= dict.fromkeys(("success", "indicator", "usage.cost_usd"), ("float64", pl.Float64))
TYPES["created_at"] = ("datetime64[us, UTC]", pl.Datetime("us", "UTC"))
TYPES |= {"metrics.load": ("Int64", pl.Int64), "flags": ("object", pl.List(pl.String))}


def test_types_and_what_is_missing_in_both_libraries() -> None:
    frame, other = jobs_frame([JOB, DONE]), jobs_frame([JOB, DONE], kind="polars")
    assert {name: (str(frame[name].dtype), other.schema[name]) for name in TYPES} == TYPES
    assert (frame["created_at"][0], other["created_at"][0]) == (pd.Timestamp(TIME), TIME)
    assert frame["seed"].tolist() == other["seed"].to_list() == [2**62, 2**62]
    missing = ["success", "indicator", "flags", "finished_at", "usage.cost_usd", "metrics.load"]
    assert frame.iloc[0][missing].isna().all()
    assert [other.row(0, named=True)[name] for name in missing] == [None] * 6
    assert frame["flags"][1] == other["flags"][1].to_list() == ["unstable", "odd"]
    assert json.loads(frame["metrics.peaks"][1]) == [1, 2]
    assert frame["usage.input_tokens"].sum() == 12


@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_a_frame_has_its_columns_whatever_a_service_says(kind) -> None:
    empty, full = jobs_frame([], kind=kind), jobs_frame([JOB], kind=kind)
    columns = list(empty.columns)
    assert columns[:7] == ["id", "task", "model", "seed", "outcome", "success", "indicator"]
    assert (len(empty), len(columns)) == (0, len(set(columns)))
    assert columns == list(full.columns)
    assert [str(one) for one in empty.dtypes] == [str(one) for one in full.dtypes]
    assert list(sweeps_frame([], kind=kind).columns)[:2] == ["id", "name"]
    assert list(results_frame([], kind=kind).columns)[1:4] == ["task", "model", "seed"]
    board = {"track": None, "tracks": [], "tasks": []}
    assert list(leaderboard_frame(board, kind=kind).columns)[:2] == ["task", "model"]
    assert "mean_rank" in leaderboard_frame(board, overall=True, kind=kind).columns
    # A field that a newer service adds does no harm, and what an older one does not say is missing.
    newer = {**JOB, "novelty": {"a": 1}, "usage": {**USAGE, "novelty": 1}}
    assert list(jobs_frame([newer], kind=kind).columns) == columns
    older = {name: value for name, value in JOB.items() if name not in {"faults", "censored"}}
    frame = jobs_frame([older, JOB], kind=kind)
    for name in ("faults", "censored"):
        assert pd.isna(frame[name].to_list()).tolist() == [True, False]
    with pytest.raises(BadArgumentError, match="choose from pandas, polars"):
        jobs_frame([], kind="os")
