"""Flags, and what is only known to be at least, wherever figures are shown."""

import csv
import json

import pytest
from sqlalchemy import insert, select, update
from support.clients.commands import printed

from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_store.tables import jobs, rollouts


@pytest.fixture
def sweep(context, submissions) -> str:
    """Bridges of one model carry everything, of another a little; a third one's are not bridges."""
    models = {
        "openai/gpt-5": (1500.0, ["never_fell"]),
        "xai/grok-4": (200.0, []),
        "builtin/random": (900.0, ["does_not_span"]),
    }
    spec = SweepSpec(name="bridges", tasks=["support-1"], models=list(models), samples=6)
    done = submissions.submit_sweep(spec)
    with context.store.database.transaction() as connection:
        for job in connection.execute(select(jobs)).all():
            load, flags = models[job.model]
            score = {"success": True, "indicator": load, "flags": flags, "metrics": {"parts": 9}}
            connection.execute(
                update(jobs)
                .where(jobs.c.id == job.id)
                .values(state="done", outcome="success", finished_at=job.created_at, **score)
            )
            trial = {"number": 0, "final": True, "engine": "pybullet", "machine_hash": "machine"}
            ended = {"job_id": job.id, "finished_at": job.created_at}
            connection.execute(insert(rollouts).values(**ended, **trial, **score))
    return str(done.sweep.id)


@pytest.mark.usefixtures("sweep")
def test_a_board_counts_disqualified_trials_as_failures(url) -> None:
    answer = json.loads(printed(url, "leaderboard", "--json"))
    rows = {row["model"]: row for row in answer["tasks"][0]["rows"]}
    assert list(rows) == ["openai/gpt-5", "xai/grok-4", "builtin/random"]
    assert rows["builtin/random"]["successes"] == 0
    text = printed(url, "leaderboard", "--task", "support-1")
    assert text.count("≥ 1,500.0") == 2  # the mean and the best
    assert "xai/grok-4" in text
    assert "too few" in text
    overview = printed(url, "leaderboard")
    assert "≥ 1,500.0" in overview
    assert "flags: 6 does_not_span, 6 never_fell" in overview
    assert "  never_fell: The bridge carried everything" in overview
    assert "not_driven" not in overview


@pytest.mark.usefixtures("sweep")
def test_comparisons_and_exports_count_them_as_failures_too(url, tmp_path) -> None:
    words = ["compare", "openai/gpt-5", "builtin/random", "--json"]
    (task,) = json.loads(printed(url, *words))["tasks"]
    assert task["successes"] == [6, 0]
    out = tmp_path / "board.csv"
    printed(url, "export", "--out", str(out))
    with out.open() as file:
        rows = {row["model"]: row for row in csv.DictReader(file)}
    assert (rows["openai/gpt-5"]["trials"], rows["openai/gpt-5"]["flags"]) == (
        "6",
        '{"never_fell": 6}',
    )
    tex = tmp_path / "board.tex"
    printed(url, "export", "--out", str(tex))
    assert r"\textbf{$\geq$1500.0}" in tex.read_text()


@pytest.mark.usefixtures("sweep")
def test_a_job_tells_its_flags_in_words(url) -> None:
    text = printed(url, "job", "list", "--flag", "never_fell")
    assert text.count("≥ 1,500.00") == 6
    job = json.loads(printed(url, "job", "list", "--flag", "never_fell", "--json"))["jobs"][0]
    assert job["censored"] is True
    shown = printed(url, "job", "show", job["id"])
    assert "indicator ≥ 1,500.000" in shown
    assert "never_fell: The bridge carried everything" in shown
