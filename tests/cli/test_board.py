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
from buildarena_cli.commands.report import variant
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
    filtered = json.loads(printed(url, "leaderboard", "--level", "2", "--json"))
    assert [task["task"] for task in filtered["tasks"]] == ["support-2", "lift-2"]
    later = printed(url, "leaderboard", "--since", "2100-01-01")
    assert "No jobs have ended yet." in later


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


@pytest.mark.nightly
def test_a_report_has_every_section_in_every_format(url, sweep, tmp_path) -> None:
    for ending in (".html", ".md", ".pdf"):
        printed(url, "report", sweep, "--out", str(tmp_path / f"report{ending}"))
    markdown = (tmp_path / "report.md").read_text()
    headings = re.findall(r"^## (.*)$", markdown, re.MULTILINE)
    assert headings == [
        "Ranking",
        "Performance",
        "Difficulty dimensions",
        "Failures",
        "Cost",
        "What these samples can show",
    ]
    assert "1 have not ended yet" in markdown
    assert "1 errored" in markdown
    assert "nan" not in markdown.lower().replace("finance", "")
    assert "85.9 %" in markdown  # GPT-5 on support-1 in the paper, beside ours
    for name in re.findall(r"\((report_files/.*?\.png)\)", markdown):
        assert (tmp_path / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    page = (tmp_path / "report.html").read_text()
    assert page.count("<img") == markdown.count("![") == 6
    assert page.count("<h2>") == len(headings)
    assert (tmp_path / "report.pdf").read_bytes()[:5] == b"%PDF-"


@pytest.mark.ci
def test_a_closed_loop_beside_single_shots(url, sweep, context, submissions, tmp_path) -> None:
    cell = {"tasks": ["support-2"], "models": ["openai/gpt-5", "xai/grok-4"], "samples": 16}
    spec = SweepSpec.model_validate({**cell, "closed_loop": {"rounds": 5, "analyst": True}})
    loop = submissions.submit_sweep(spec).sweep.id
    end_jobs(context, rounds=5)
    out = tmp_path / "report.md"
    printed(url, "report", sweep, loop, "--out", str(out))
    text = out.read_text()
    assert "## Closed loop" in text
    assert "openai/gpt-5 (5 rounds + analyst)" in text
    assert "openai/gpt-5 (main)" in text
    assert re.findall(r"rounds-(.*?)\.png", text) == ["support-2"]
    line = next(
        line
        for line in text.splitlines()
        if line.startswith("| openai/gpt-5 (5 rounds") and line.count(" / ") == 5
    )
    rates = [float(rate) for rate in re.findall(r"([\d.]+) %", line)]
    assert rates == sorted(rates)
    assert rates[-1] > rates[0]


@pytest.mark.ci
def test_simulators_are_compared_on_the_same_machines(url, context, submissions, tmp_path):
    sweeps = []
    for simulator in ("pybullet", "mujoco"):
        spec = SweepSpec(
            tasks=["support-1"], models=["openai/gpt-5"], samples=3, simulator=simulator
        )
        sweeps.append(submissions.submit_sweep(spec).sweep.id)
    with context.store.database.transaction() as connection:
        for number, job in enumerate(connection.execute(select(jobs).order_by(jobs.c.id)).all()):
            won = number > 0
            connection.execute(
                update(jobs)
                .where(jobs.c.id == job.id)
                .values(state="done", outcome="success", success=True, indicator=1.0)
            )
            trial = {"machine_hash": f"machine {job.seed}", "indicator": float(job.seed)}
            add_rollout(connection, job, success=won, **trial)
    printed(url, "report", *sweeps, "--out", str(tmp_path / "r.md"))
    text = (tmp_path / "r.md").read_text()
    assert "| support-1 | mujoco, pybullet | 3 | 66.7 % | 0.00 | 1.00 |" in text


def test_a_report_of_nothing_scored_says_so(url, context, submissions, tmp_path) -> None:
    spec = SweepSpec(tasks=["lift-1"], models=["builtin/idle"], samples=1)
    sweep = submissions.submit_sweep(spec).sweep.id
    for _ in range(2):
        for ending in (".html", ".md", ".pdf"):
            printed(url, "report", sweep, "--out", str(tmp_path / f"r{ending}"))
        assert "No job was scored." in (tmp_path / "r.md").read_text()
        lease = context.store.leases.claim("construct", owner="w")
        if lease:
            context.store.leases.give_up(lease, "gone", reason="lost_worker")
    assert "1 errored" in (tmp_path / "r.md").read_text()
    bad = run_cli(url, "report", sweep, "--out", str(tmp_path / "r.doc"))
    assert (bad.returncode, "must end in .html" in bad.stderr) == (1, True)
    assert run_cli(url, "report", "sweep_x", "--out", str(tmp_path / "r.md")).returncode == 1


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
        done = run_cli(url, "audit", "xai/grok-4", "--sample", "4")
    finally:
        stopping.set()
        worker.join()
    assert done.returncode == 1
    assert re.search(r"4 of (7[5-9]|80) results checked", done.stdout)
    assert done.stdout.count("score: indicator: kept 1, found 2") == 2


@pytest.mark.parametrize(
    ("spec", "name"),
    [
        ({}, ""),
        ({"decoding": {"temperature": 0.5, "top_p": 0.7, "max_tokens": None}}, ""),
        ({"decoding": {"temperature": 1.0, "top_p": 0.7}}, "temperature 1.0"),
        ({"decoding": {"temperature": 0.5}}, "top p default"),
        ({"workflow": "builder", "one_shot": True}, "builder, one-shot"),
        ({"closed_loop": {"rounds": 5, "analyst": False}}, "5 rounds"),
    ],
)
def test_a_variant_is_named_by_what_differs_from_the_main_experiment(spec, name) -> None:
    assert variant(spec) == name
