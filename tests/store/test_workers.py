"""The register of workers: pages, a few numbers, and old names that go."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import text
from support.statements import statements_of

from buildarena_pipeline.runtime.worker_process import worker_id

RUNNER = "runner@key_1/"


@pytest.fixture
def store(context):
    return context.store


@pytest.fixture
def report(store):
    def say(name: str, **more) -> None:
        values = {"kind": "simulate", "queues": ["simulate.mujoco"], "host": "h", "pid": 1}
        store.workers.report(worker_id=name, versions={"simulation": "3"}, **values | more)

    return say


def silence(store, name: str) -> None:
    with store.database.transaction() as connection:
        connection.execute(
            text("UPDATE workers SET seen_at = now() - interval '1 minute' WHERE id = :id"),
            {"id": name},
        )


def test_pages_follow_each_other_though_workers_report_meanwhile(store, report) -> None:
    names = [f"w{number}" for number in range(5)]
    for name in names:
        report(name)
    seen, after = [], None
    while page := store.workers.page(limit=2, after=after):
        seen += [worker.id for worker in page]
        after = page[-1].started_at, page[-1].id
        report(names[0])
    assert seen == names[::-1]


def test_the_register_in_a_few_numbers_reads_no_versions(store, report) -> None:
    now = datetime.now(UTC)
    report("a", peak_memory_bytes=5, own_time=now)
    report("b", peak_memory_bytes=9, own_time=now + timedelta(hours=1))
    report("c", queues=["simulate.mujoco", "simulate.pybullet"])
    report("d", kind="construct", queues=["construct"])
    report("gone")
    silence(store, "gone")
    with statements_of(store.database.engine) as statements:
        counts = store.workers.counts()
    assert statements
    assert not any("versions" in statement for statement in statements)
    assert counts.serving == {"simulate.mujoco": 3, "simulate.pybullet": 1, "construct": 1}
    assert counts.alive == {"simulate": 3, "construct": 1}
    assert counts.lost == {"simulate": 1, "construct": 0}
    assert counts.peak_memory_bytes == {"simulate": 9}
    assert [name for name, _ in counts.clocks] == ["b", "a"]
    assert counts.clocks[0][1] == pytest.approx(3600, abs=5)


def test_what_many_workers_announce_is_said_once(store, report) -> None:
    for number in range(20):
        report(f"w{number}")
    (announcement,) = store.workers.announcements()
    assert announcement.versions == {"simulation": "3", "kind": None, "repeatable": None}


def test_a_key_has_so_many_names_and_touches_no_others(store, report) -> None:
    for number in range(9):
        report(f"{RUNNER}{number}")
    report("runner@key_2/x")
    store.workers.trim(RUNNER, most=3)
    ids = {worker.id for worker in store.workers.page(limit=100)}
    assert ids == {f"{RUNNER}{number}" for number in (6, 7, 8)} | {"runner@key_2/x"}


def test_workers_that_are_killed_under_the_same_number_are_all_counted_as_lost(
    store, report
) -> None:
    killed = [worker_id("simulate") for _ in range(5)]
    for name in killed:
        report(name)
        silence(store, name)
    report(worker_id("simulate"))
    assert store.workers.counts().lost == {"simulate": 5}


def test_a_host_forgets_its_workers_that_were_killed_and_nobody_elses(store, report) -> None:
    report("killed", pid=2)
    report("running", pid=3)
    report("elsewhere", pid=2, host="other")
    store.workers.forget_ended("h", lambda pid: pid == 3)
    assert {worker.id for worker in store.workers.page(limit=9)} == {"running", "elsewhere"}
