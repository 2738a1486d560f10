"""Figures of the service and of sweeps; pages of jobs; the register of workers."""

from collections import Counter
from datetime import UTC, datetime, timedelta

import pytest
from benchmarks.filling import Amount, fill
from sqlalchemy import select, text, update
from support.jobs import execute

from buildarena_backend.database.tables import jobs, sweep_jobs
from buildarena_backend.process.worker_process import worker_id
from buildarena_backend.sweeps.sweeps import COUNTED_EVERY_S
from buildarena_backend.telemetry.metrics import STAGE_SECONDS

RUNNER = "runner@key_1/"


@pytest.fixture
def store(context):
    return context.store


@pytest.fixture
def filled(store):
    fill(store.database, Amount(ended=900, queued=400, models=5))
    return store


def require_progress(store) -> None:
    """The progress of every sweep is that which its jobs, counted one by one, come to."""
    query = select(sweep_jobs.c.sweep_id, jobs).join(jobs, jobs.c.id == sweep_jobs.c.job_id)
    members: dict[str, list] = {sweep.id: [] for sweep in store.sweeps.page(limit=100)}
    with store.database.statement() as connection:
        for row in connection.execute(query):
            members[row.sweep_id].append(row)
    assert members
    for sweep_id, progress in store.sweeps.progress_of(list(members)).items():
        rows = members[sweep_id]
        waiting = [row for row in rows if row.state != "done"]
        assert progress.total == len(rows)
        assert progress.outcomes == Counter(row.outcome for row in rows if row.state == "done")
        assert progress.stages == Counter(f"{row.stage} {row.state}" for row in waiting)
        for name in ("requests", "lost_requests", "input_tokens", "output_tokens", "cost_usd"):
            assert getattr(progress, name) == sum(getattr(row, name) for row in rows), name


def test_figures_are_those_of_the_jobs_one_by_one(filled) -> None:
    with filled.database.transaction() as connection:
        ids = connection.execute(select(jobs.c.id).order_by(jobs.c.id)).scalars().all()
        changes = (
            {"state": "done", "outcome": "errored", "reason": "lost_worker"},
            {"cost_usd": 1.5, "requests": 7, "lost_requests": 2},
            {"audit": "required"},
        )
        for number, change in enumerate(changes):
            some = jobs.c.id.in_(ids[number::9])
            connection.execute(update(jobs).where(some).values(**change))
        every = connection.execute(select(jobs)).all()
    require_progress(filled)
    figures = filled.metrics.read()
    why = {j.id: j.reason if j.outcome == "errored" else "" for j in every}
    assert figures.jobs == Counter((j.state, j.stage, j.outcome or "", why[j.id]) for j in every)
    queued = Counter(job.queue for job in every if job.state == "queued")
    assert {one.queue: one.jobs for one in figures.queues} == queued
    assert all(one.oldest_s >= 0 for one in figures.queues)
    for model, use in figures.models.items():
        own = [job for job in every if job.model == model]
        for name in ("requests", "input_tokens", "output_tokens"):
            assert use[name] == sum(getattr(job, name) for job in own)
        assert float(use["cost_usd"]) == pytest.approx(float(sum(job.cost_usd for job in own)))
    assert figures.models.keys() == {job.model for job in every}
    assert figures.audits["required"] == sum(job.audit == "required" for job in every)
    assert figures.audits["verified"] == 0


def test_a_large_sweeps_progress_is_counted_anew_after_some_seconds(filled, monkeypatch) -> None:
    monkeypatch.setattr("buildarena_backend.sweeps.sweeps.LARGE", 10)
    before = filled.sweeps.progress("sweep_ended0")
    with filled.database.transaction() as connection:
        connection.execute(update(jobs).values(state="queued", stage="construct", outcome=None))
    assert filled.sweeps.progress("sweep_ended0") == before
    filled.sweeps._large.expire(filled.sweeps._large.timer() + COUNTED_EVERY_S + 1)
    assert filled.sweeps.progress("sweep_ended0").outcomes == {}


def test_attempts_are_counted_by_how_long_they_took(filled) -> None:
    insert = text(
        "INSERT INTO attempts (job_id, token, stage, worker, started_at, ended_at, result) SELECT "
        "min(id), :token, 'construct', 'w', now(), now() + :s * interval '1 s', 'done' FROM jobs"
    )
    near = [bound + by for bound in STAGE_SECONDS for by in (-0.0005, 0.0005)]
    with filled.database.transaction() as connection:
        connection.execute(text("DELETE FROM attempts"))
        for number, seconds in enumerate(near):
            connection.execute(insert, {"token": 100 + number, "s": seconds})
    ((place, (counts, total_s)),) = filled.metrics.read().stages.items()
    assert place == ("construct", "done")
    # Each class has its lower bound in it.
    assert counts == [1] + [2] * (len(STAGE_SECONDS) - 1) + [1]
    assert total_s == pytest.approx(sum(near))


@pytest.fixture
def report(store):
    def say(name: str, **more) -> None:
        values = {"kind": "simulate", "queues": ["simulate.mujoco"], "host": "h", "pid": 1}
        store.workers.report(worker_id=name, versions={"simulation": "3"}, **values | more)

    return say


def silence(context, *names: str) -> None:
    silent = "UPDATE workers SET last_heartbeat_at = now() - interval '1 minute'"
    execute(context, f"{silent} WHERE id = ANY(:ids)", {"ids": list(names)})


def test_pages_of_workers_follow_each_other_though_they_report_meanwhile(store, report) -> None:
    names = [f"w{number}" for number in range(5)]
    for name in names:
        report(name)
    seen, after = [], None
    while page := store.workers.page(limit=2, after=after):
        seen += [worker.id for worker in page]
        after = page[-1].started_at, page[-1].id
        report(names[0])
    assert seen == names[::-1]
    (announcement,) = store.workers.announcements()
    assert announcement[1:] == ("3", None, None)


def test_the_register_of_workers_in_a_few_numbers(context, store, report) -> None:
    now = datetime.now(UTC)
    report("a", peak_memory_bytes=5, reported_at=now)
    report("b", peak_memory_bytes=9, reported_at=now + timedelta(hours=1))
    report("c", queues=["simulate.mujoco", "simulate.pybullet"])
    report("d", kind="construct", queues=["construct"])
    killed = [worker_id("simulate") for _ in range(3)]  # under the same number
    for name in killed:
        report(name)
    silence(context, *killed)
    counts = store.workers.counts()
    assert counts.serving == {"simulate.mujoco": 3, "simulate.pybullet": 1, "construct": 1}
    assert counts.alive == {"simulate": 3, "construct": 1}
    assert counts.lost == {"simulate": 3, "construct": 0}
    assert counts.peak_memory_bytes == {"simulate": 9}
    assert [name for name, _ in counts.clocks] == ["b", "a"]
    assert counts.clocks[0][1] == pytest.approx(3600, abs=5)


def test_names_of_keys_and_of_killed_workers_go_and_no_others(store, report) -> None:
    for number in range(9):
        report(f"{RUNNER}{number}", host="there")
    report("runner@key_2/x", host="there")
    store.workers.trim(RUNNER, limit=3)
    report("killed", pid=2)
    report("running", pid=3)
    report("elsewhere", pid=2, host="other")
    store.workers.forget_ended("h", lambda pid: pid == 3)
    left = {f"{RUNNER}{number}" for number in (6, 7, 8)} | {"runner@key_2/x"}
    ids = {worker.id for worker in store.workers.page(limit=100)}
    assert ids == left | {"running", "elsewhere"}
