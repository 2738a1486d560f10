"""The leaderboard's commands against a live API with a sweep of made-up results."""

import csv
import json
import random
import re
import threading
import time

import pytest
from sqlalchemy import insert, select, update
from support.clients.commands import printed, run_cli

from buildarena_benchmark.leaderboard import published_rows
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_store.states import Verdict
from buildarena_store.tables import jobs, rollouts

TASKS = ["transport-1", "support-1", "support-2", "lift-1", "lift-2"]
MODELS = ["openai/gpt-5", "xai/grok-4", "anthropic/claude-sonnet-4", "builtin/random"]


@pytest.fixture
def sweep(context, submissions) -> str:
    """A sweep whose results follow the paper's rates; one job has not ended, one errored."""
    done = submissions.submit_sweep(SweepSpec(tasks=TASKS, models=MODELS, samples=16))
    end_jobs(context)
    return str(done.sweep.id)


def add_rollout(connection, job, **values: object) -> None:
    usual = {"job_id": job.id, "number": 0, "final": True, "engine": "pybullet"}
    finished = {"finished_at": job.created_at}
    connection.execute(insert(rollouts).values(**{**usual, **finished, **values}))


def end_jobs(context, *, rounds: int = 1) -> None:
    rng = random.Random(7)
    snapshots = {name: entry.model for name, entry in load_registry().models.items()}
    with context.store.database.transaction() as connection:
        found = connection.execute(select(jobs).where(jobs.c.state == "queued").order_by(jobs.c.id))
        for number, job in enumerate(found.all()):
            if number == 0:
                continue
            rows = [r for r in published_rows()[job.task] if r.snapshot == snapshots[job.model]]
            rate = rows[0].success_rate if rows else 0.0
            tries = [rng.random() < rate for _ in range(rounds)]
            if True in tries:
                tries = tries[: tries.index(True) + 1]
            size = rows[0].indicator_mean / max(rate, 0.05) if rows else 1.0
            values = [rng.uniform(0.6, 1.4) * size if won else 0.0 for won in tries]
            errored = number == 1
            outcome = "success" if tries[-1] else "unsuccessful"
            connection.execute(
                update(jobs)
                .where(jobs.c.id == job.id)
                .values(
                    state="done",
                    outcome="errored" if errored else outcome,
                    reason="provider_outage" if errored else None,
                    success=None if errored else tries[-1],
                    indicator=None if errored else max(values),
                    metrics={"parts": rng.randrange(5, 60)},
                    flags=[],
                    refusals={"overlap": rng.randrange(4), "face_occupied": rng.randrange(3)},
                    actions=40,
                    refused_actions=3,
                    requests=50,
                    input_tokens=rng.randrange(10**5, 10**6),
                    output_tokens=int(rng.lognormvariate(10, 1)),
                    cost_usd=round(rng.random(), 4),
                    finished_at=job.created_at,
                )
            )
            for place, (won, value) in enumerate(zip(tries, values, strict=True)):
                trial = {"number": place, "machine_hash": f"machine {place}", "indicator": value}
                last = place == len(tries) - 1
                add_rollout(connection, job, **trial, final=last, success=won, metrics={"parts": 9})


@pytest.mark.ci
@pytest.mark.usefixtures("sweep")
def test_the_leaderboard_shows_shared_ranks(url) -> None:
    text = printed(url, "leaderboard", "--task", "support-1", "--task", "lift-1")
    assert "All tasks together" in text
    assert "openai/gpt-5" in text


@pytest.mark.ci
@pytest.mark.usefixtures("sweep")
def test_two_models_are_compared_task_by_task(url) -> None:
    words = ["compare", "openai/gpt-5", "builtin/random"]
    assert "p success" in printed(url, *words)
    answer = json.loads(printed(url, *words, "--json"))
    by_task = {task["task"]: task for task in answer["tasks"]}
    assert by_task["support-1"]["success_p"] < 0.05
    assert by_task["support-1"]["success"]["pairs"] in {15, 16}
    unknown = run_cli(url, "compare", "openai/gpt-5", "x/y")
    assert unknown.returncode == 1
    assert "builtin/random@" in unknown.stderr


@pytest.mark.ci
@pytest.mark.usefixtures("sweep")
def test_exports_are_files_of_the_asked_format(url, tmp_path) -> None:
    for ending in (".csv", ".parquet", ".tex"):
        printed(url, "export", "--out", str(tmp_path / f"board{ending}"))
    with (tmp_path / "board.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert "openai/gpt-5" in {row["model"] for row in rows}
    assert r"\toprule" in (tmp_path / "board.tex").read_text()
    assert (tmp_path / "board.parquet").read_bytes()[:4] == b"PAR1"
    bad = run_cli(url, "export", "--out", str(tmp_path / "board.xls"))
    assert (bad.returncode, "must end in .csv" in bad.stderr) == (1, True)
    nowhere = run_cli(url, "export", "--out", str(tmp_path / "no" / "board.csv"))
    assert "can't be written" in nowhere.stderr


@pytest.mark.ci
@pytest.mark.usefixtures("sweep")
def test_an_audit_tells_every_difference(url, context) -> None:
    stopping = threading.Event()

    def verify() -> None:
        """Stands in for the worker: every second check finds another indicator."""
        number = 0
        while not stopping.is_set():
            while (claimed := context.store.verifications.claim_next()) is not None:
                number += 1
                check = {"name": "score: indicator", "ok": number % 2 == 0, "kept": 1, "found": 2}
                report = {"ok": check["ok"], "checks": [check]}
                verdict = Verdict.VERIFIED if check["ok"] else Verdict.REFUTED
                context.store.verifications.finish(claimed.id, report, verdict=verdict)
            time.sleep(0.05)

    worker = threading.Thread(target=verify)
    worker.start()
    try:
        done = run_cli(url, "job", "verify", "--model", "xai/grok-4", "--sample", "4")
    finally:
        stopping.set()
        worker.join()
    assert done.returncode == 1
    assert re.search(r"4 of (7[5-9]|80) results checked", done.stdout)
    assert done.stdout.count("score: indicator: kept 1, found 2") == 2
