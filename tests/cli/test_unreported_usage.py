"""What an external agent did not report is a dash, and null for programs: never 0."""

import csv
import io
import json
from urllib.request import urlopen

import pyarrow.parquet as pq
import pytest
from support.clients.commands import printed
from support.stages import work

from buildarena_pipeline.agents.sessions import ExternalSessions

REPORTED = ("requests", "input_tokens", "output_tokens", "cost_usd")
MEANS = tuple(f"{name}_mean" for name in REPORTED)


@pytest.fixture
def ended(context) -> str:
    """A session that ended; its job's id."""
    sessions = ExternalSessions(context)
    job = sessions.open(task="support-1", agent="me", seed=0, simulator="mujoco").job
    for tool, arguments in (
        ("start", {}),
        ("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Torch"}),
    ):
        sessions.call(job.id, machine="main", tool=tool, arguments=arguments)
    sessions.submit(job.id)
    work(context)
    return str(job.id)


def fetched(url: str, path: str) -> bytes:
    with urlopen(url + path) as answer:
        return bytes(answer.read())


def test_a_jobs_usage_is_null_and_a_dash(url, ended) -> None:
    job = json.loads(fetched(url, f"/v1/jobs/{ended}"))
    assert set(job["usage"]) > {*REPORTED}
    assert set(job["usage"].values()) == {None}
    (listed,) = json.loads(fetched(url, "/v1/jobs"))["jobs"]
    assert listed["usage"] == job["usage"]
    assert listed["actions"] == 2  # what the service counts itself stays
    shown = printed(url, "job", "show", ended)
    assert "usage     - requests, - tokens in, - out, $-" in shown
    assert "actions   2, 0 refused" in shown


@pytest.mark.usefixtures("ended")
def test_a_boards_means_are_null_and_dashes(url) -> None:
    board = json.loads(fetched(url, "/v1/leaderboard"))
    (row,) = next(task["rows"] for task in board["tasks"] if task["task"] == "support-1")
    assert row["model"] == "agent/me"
    assert row["trials"] == 1
    assert [row[name] for name in (*MEANS, "cost_per_success_usd")] == [None] * 5
    (overall,) = board["overall"]
    assert overall["cost_usd_mean"] is None
    assert not overall["pareto"]
    table = printed(url, "leaderboard", "--task", "support-1")
    (line,) = [line for line in table.splitlines() if "agent/me" in line and "/1" in line]
    assert line.split()[-3:] == ["-", "-", "-"]  # requests, tokens and dollars


@pytest.mark.usefixtures("ended")
def test_exports_leave_them_empty(url) -> None:
    path = "/v1/leaderboard/export?format="
    rows = csv.DictReader(io.StringIO(fetched(url, path + "csv").decode()))
    (row,) = [row for row in rows if row["model"] == "agent/me"]
    assert [row[name] for name in MEANS] == [""] * 4
    table = pq.read_table(io.BytesIO(fetched(url, path + "parquet"))).to_pylist()
    (typed,) = [row for row in table if row["model"] == "agent/me"]
    assert [typed[name] for name in MEANS] == [None] * 4
    text = fetched(url, path + "latex").decode()
    cost = text.partition("% Measured: cost")[2].partition("% Published")[0]
    (line,) = [line for line in cost.splitlines() if "agent/me" in line]
    assert "0" not in line


def test_a_baseline_that_used_nothing_still_says_so(url, context, submissions) -> None:
    from buildarena_pipeline.catalog.specs import SweepSpec

    submissions.submit_sweep(
        SweepSpec(tasks=["support-1"], models=["builtin/idle"], seeds=[0], simulator="mujoco")
    )
    work(context)
    (job,) = json.loads(fetched(url, "/v1/jobs"))["jobs"]
    assert job["usage"]["requests"] > 0
    assert job["usage"]["cost_usd"] == 0
