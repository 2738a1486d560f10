"""Counts that triggers keep are those that counting finds, and the benchmark's database is real."""

import random
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest
from benchmarks.filling import TRACKS, Amount, fill
from sqlalchemy import delete, func, select, text, update

from buildarena_store import STAGE_SECONDS, NewSweep, TrialFilter
from buildarena_store.derived_tables import figure_changes
from buildarena_store.jobs.filters import JobFilter
from buildarena_store.jobs.pages import Order
from buildarena_store.tables import attempts, jobs, sweep_jobs


@pytest.fixture
def filled(context):
    fill(context.store.database, Amount(ended=900, queued=400, models=5))
    return context


def counted(context) -> object:
    """The figures after counting anew; how long the oldest has waited goes on."""
    with context.store.database.transaction() as connection:
        connection.execute(text("SELECT recount_jobs()"))
    return as_said(context.store.metrics.read())


def as_said(figures) -> object:
    return (
        sorted((j.state, j.stage, j.outcome, j.reason, j.jobs) for j in figures.jobs if j.jobs),
        sorted((queue.queue, queue.jobs) for queue in figures.queues),
        sorted(
            (m.model, m.requests, m.input_tokens, m.output_tokens, round(m.cost_usd, 6))
            for m in figures.models
        ),
        [(s.stage, s.result, list(s.counts), round(s.total_s, 3)) for s in figures.stages],
    )


def require_progress(context) -> None:
    """The progress of every sweep is that which its jobs, counted one by one, come to."""
    query = select(sweep_jobs.c.sweep_id, jobs).join(jobs, jobs.c.id == sweep_jobs.c.job_id)
    members: dict[str, list] = {sweep.id: [] for sweep in context.store.sweeps.page(limit=100)}
    with context.store.database.statement() as connection:
        for row in connection.execute(query):
            members[row.sweep_id].append(row)
    assert members
    for sweep_id, progress in context.store.sweeps.progress_of(list(members)).items():
        rows = members[sweep_id]
        ended = [row for row in rows if row.state == "done"]
        assert progress.total == len(rows)
        assert progress.outcomes == Counter(row.outcome for row in ended)
        assert progress.stages == Counter(
            f"{row.stage} {row.state}" for row in rows if row.state != "done"
        )
        for name in ("requests", "lost_requests", "input_tokens", "output_tokens", "cost_usd"):
            assert getattr(progress, name) == sum(getattr(row, name) for row in rows), name


def test_kept_counts_are_those_that_counting_finds(filled) -> None:
    store, rng = filled.store, random.Random(1)
    for step in range(25):
        with store.database.transaction() as connection:
            ids = connection.execute(select(jobs.c.id).order_by(jobs.c.id)).scalars().all()
            some = jobs.c.id.in_(rng.sample(ids, 20))
            if step % 5 == 0:
                connection.execute(update(jobs).where(some).values(state="done", outcome="limit"))
            elif step % 5 == 1:
                values = {"state": "queued", "outcome": None, "queue": "simulate.mujoco"}
                connection.execute(update(jobs).where(some).values(**values))
            elif step % 5 == 2:
                connection.execute(
                    update(jobs).where(some).values(cost_usd=1.5, requests=step, lost_requests=step)
                )
            elif step % 5 == 3:
                gone = connection.execute(select(jobs.c.id).where(some)).scalars().all()
                for table in (attempts, sweep_jobs):
                    connection.execute(delete(table).where(table.c.job_id.in_(gone)))
            else:
                values = {"outcome": "errored", "reason": f"class {step}"}
                connection.execute(update(jobs).where(some).values(**values))
        for _ in range(3):
            lease = store.leases.claim("construct", owner="w")
            if step % 2:
                store.leases.hand_back(lease)
            else:
                store.leases.give_up(lease, "gone", reason="lost_worker")
        if step % 4 == 0:
            store.metrics.read()
    require_progress(filled)
    kept = as_said(store.metrics.read())
    with store.database.transaction() as connection:
        # Attempts that were taken out have been counted.
        connection.execute(text("CREATE TEMP TABLE stages AS SELECT * FROM figures"))
    jobs_now, queues, models, _ = counted(filled)
    assert kept[:3] == (jobs_now, queues, models)


def test_a_job_that_moves_while_a_sweep_takes_it_in_is_counted_once(filled) -> None:
    """Whichever of the two began first, and whichever ends first."""
    store = filled.store
    with store.database.statement() as connection:
        first, second = connection.execute(
            select(jobs.c.id).where(jobs.c.state == "queued").order_by(jobs.c.id).limit(2)
        ).scalars()

    def move(job_id, connection) -> None:
        done = {"state": "done", "outcome": "limit", "requests": 7}
        connection.execute(update(jobs).where(jobs.c.id == job_id).values(**done))

    def take_in(name) -> None:
        with store.lifecycle.submission() as connection:
            store.sweeps.add(
                NewSweep(id=name, name=name, spec={}), [first, second], connection=connection
            )

    with ThreadPoolExecutor(1) as pool:
        with store.database.transaction() as moving:
            move(first, moving)
            taking = pool.submit(take_in, "sweep_later")
            wait_until_blocked(store)
        taking.result()
        require_progress(filled)
        with store.lifecycle.submission() as connection:
            store.sweeps.add(
                NewSweep(id="sweep_first", name="first", spec={}),
                [first, second],
                connection=connection,
            )

            def move_alone() -> None:
                with store.database.transaction() as own:
                    move(second, own)

            moving = pool.submit(move_alone)
            wait_until_blocked(store)
        moving.result()
    require_progress(filled)
    assert store.sweeps.progress("sweep_first").outcomes == {"limit": 2}


def wait_until_blocked(store) -> None:
    """Until another transaction waits for a lock."""
    waiting = text("SELECT count(*) FROM pg_locks WHERE NOT granted")
    for _ in range(500):
        with store.database.statement() as connection:
            if connection.execute(waiting).scalar():
                return
        time.sleep(0.02)
    raise AssertionError("nobody waits")


def test_attempts_are_counted_by_how_long_they_took(filled) -> None:
    assert as_said(filled.store.metrics.read()) == counted(filled)
    store = filled.store
    with store.database.transaction() as connection:
        for number, bound in enumerate(STAGE_SECONDS):
            for way in (0, 1):
                connection.execute(
                    text(
                        "INSERT INTO attempts (job_id, token, stage, worker, started_at, ended_at, "
                        "result) SELECT min(id), :token, 'construct', 'w', now(), "
                        "now() + :seconds * interval '1 second', 'done' FROM jobs"
                    ),
                    {"token": 100 + 2 * number + way, "seconds": bound + (way - 0.5) / 1000},
                )
    assert as_said(store.metrics.read()) == counted(filled)


def test_changes_are_gathered(filled) -> None:
    store = filled.store
    store.leases.claim("construct", owner="w")
    store.metrics.read()
    with store.database.transaction() as connection:
        assert connection.execute(select(func.count()).select_from(figure_changes)).scalar() == 0


@pytest.mark.ci
@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("few", [0, 40_000])
@pytest.mark.parametrize("descending", [False, True])
@pytest.mark.parametrize(
    "by", ["created", "finished", "indicator", "cost", "task", "model", "seed"]
)
def test_pages_in_every_order_hold_each_job_once(filled, monkeypatch, few, descending, by) -> None:
    """Whether all that a filter finds are sorted, or the order's index is gone along."""
    monkeypatch.setattr("buildarena_store.jobs.pages.MAX_SORTED", few)
    monkeypatch.setattr("buildarena_store.jobs.filters.MAX_SORTED", few)
    store = filled.store
    with store.database.transaction() as connection:
        external = {"name": "x", "provider": "external"}
        connection.execute(
            update(jobs).where(jobs.c.model == "made-up/model-1").values(model_config=external)
        )
        every = connection.execute(
            select(
                jobs.c.id, jobs.c.created_at, jobs.c.finished_at, jobs.c.indicator, jobs.c.task,
                jobs.c.model, jobs.c.seed, jobs.c.outcome, jobs.c.state, jobs.c.track, jobs.c.flags,
                jobs.c.cost_usd,
            )
        ).all()  # fmt: skip

    def value(row) -> object:
        if by == "cost":
            return None if row.model == "made-up/model-1" else row.cost_usd
        return getattr(row, {"created": "created_at", "finished": "finished_at"}.get(by, by))

    wanted = {
        "all": (JobFilter(), lambda _: True),
        "queued": (JobFilter(equals={"state": "queued"}), lambda row: row.state == "queued"),
        "done": (JobFilter(equals={"state": "done"}), lambda row: row.state == "done"),
        "errored": (
            JobFilter(equals={"outcome": "errored"}),
            lambda row: row.outcome == "errored",
        ),
        "flagged": (JobFilter(flag="unstable"), lambda row: "unstable" in (row.flags or ())),
        "track": (JobFilter(equals={"track": TRACKS[1]}), lambda row: row.track == TRACKS[1]),
        "text": (JobFilter(text="LIFT"), lambda row: "lift" in row.task),
        "id": (JobFilter(text="b_a"), lambda row: "b_a" in row.id),
        "sweep": (JobFilter(sweep_id="sweep_ended0"), lambda row: row.state == "done"),
    }
    for name, (chosen, holds) in wanted.items():
        rows = [row for row in every if holds(row)]
        known = [row for row in rows if value(row) is not None]
        known.sort(key=lambda row: (value(row), row.id), reverse=descending)
        unknown = sorted((row.id for row in rows if value(row) is None), reverse=descending)
        found, after = [], None
        while page := store.jobs.page(
            limit=170, after=after, wanted=chosen, order=Order(by=by, descending=descending)
        ):
            found += [job.id for job in page]
            last = next(row for row in rows if row.id == page[-1].id)
            after = value(last), last.id
        assert found == [*(row.id for row in known), *unknown], name


def test_what_the_benchmark_makes_up_is_on_its_boards(filled) -> None:
    boards = filled.store.results.boards
    cells = boards.cells.feed(None).cells
    assert sum(record.jobs for record in cells) == len(boards.trials(TrialFilter())) == 900
    assert len(cells) == 9 * 5 * 2
