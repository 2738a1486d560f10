"""Garbage collection removes what nothing refers to, late, and never anything else."""

import os
import time
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import text
from support.jobs import attach, execute

from buildarena_store import ArtifactMissingError
from buildarena_store.artifacts import GarbageCollector
from buildarena_store.artifacts.collecting import LOCK

DAY_S = 86_400
KEEP = timedelta(days=7)


@pytest.fixture
def collector(context) -> GarbageCollector:
    return GarbageCollector(context.store.database, context.artifacts, keep=KEEP)


@pytest.fixture
def folder(context) -> Path:
    return context.settings.data / "artifacts"


def age(folder: Path, days: float) -> None:
    """Everything in the store was written so long ago."""
    then = time.time() - days * DAY_S
    for file in folder.rglob("*"):
        if file.is_file():
            os.utime(file, (then, then))


@pytest.mark.ci
def test_only_old_bytes_that_nothing_refers_to_go_and_only_after_the_trash(
    context, add, collector, folder
) -> None:
    (job,) = add(1)
    kept = attach(context, job, {"machine": b"a bridge"})["machine"]
    orphan = context.artifacts.put(b"an upload that was broken off", "text/plain").hash
    age(folder, 8)
    young = context.artifacts.put(b"its row is not committed yet", "text/plain").hash
    said = collector.collect(dry_run=True)
    done = collector.collect()
    assert said == done
    assert (done.kept, done.young, done.trashed, done.deleted) == (1, 1, 1, 0)
    assert done.trashed_bytes == len(b"an upload that was broken off")
    assert context.artifacts.get(kept) == b"a bridge"
    assert context.artifacts.get(young)
    with pytest.raises(ArtifactMissingError):
        context.artifacts.get(orphan)
    assert collector.collect().deleted == 0  # the trash counts from the move
    age(folder / "trash", 8)
    assert collector.collect().deleted == 1
    assert not list((folder / "trash").rglob(orphan))


@pytest.mark.parametrize("column", ["machine_hash", "trajectory_hash"])
def test_what_a_rollout_names_is_no_garbage(context, add, collector, folder, column) -> None:
    (job,) = add(1)
    digest = context.artifacts.put(column.encode(), "text/plain").hash
    values = {"machine_hash": "0" * 64, "trajectory_hash": None, column: digest}
    execute(
        context,
        "INSERT INTO rollouts (job_id, number, final, engine, machine_hash, trajectory_hash)"
        " VALUES (:job, 0, true, 'mujoco', :machine_hash, :trajectory_hash)",
        {"job": job, **values},
    )
    age(folder, 30)
    assert collector.collect().trashed == 0
    assert context.artifacts.get(digest) == column.encode()


def attach_again(context, job: str, digest: str) -> None:
    """A job refers to bytes that are in the trash."""
    values = {"job": job, "hash": digest}
    execute(context, "INSERT INTO artifacts VALUES (:hash, 'text/plain', 5)", values)
    execute(context, "INSERT INTO job_artifacts VALUES (:job, 'machine', :hash)", values)


def test_what_is_referred_to_again_comes_back_from_the_trash(
    context, add, collector, folder
) -> None:
    (job,) = add(1)
    digest = context.artifacts.put(b"the same bridge", "text/plain").hash
    age(folder, 8)
    assert collector.collect().trashed == 1
    attach_again(context, job, digest)
    age(folder, 30)
    assert collector.collect().taken_back == 1
    assert context.artifacts.get(digest) == b"the same bridge"


def test_a_reference_that_appears_during_the_move_undoes_it(
    context, add, collector, folder, monkeypatch
) -> None:
    (job,) = add(1)
    digest = context.artifacts.put(b"raced", "text/plain").hash
    age(folder, 8)
    move = context.artifacts.trash

    def and_somebody_refers(_: object, found: str) -> None:
        move(found)
        attach_again(context, job, found)

    monkeypatch.setattr(type(context.artifacts), "trash", and_somebody_refers)
    assert collector.collect().trashed == 0
    assert context.artifacts.get(digest) == b"raced"


def test_strange_files_are_left_alone(context, collector, folder) -> None:
    context.artifacts.put(b"x", "text/plain")
    strange = [folder / "probe/abc", folder / "ab/short", folder / "notes.txt"]
    for file in strange:
        file.parent.mkdir(exist_ok=True)
        file.write_text("mine")
    age(folder, 400)
    assert collector.collect().trashed == 1
    assert all(file.exists() for file in strange)


def test_it_waits_for_nobody_and_a_backup_holds_it_off(context, collector) -> None:
    with context.store.database.engine.connect() as connection:
        connection.execute(text("SELECT pg_advisory_lock_shared(:key)"), {"key": LOCK})
        assert collector.collect() is None
        connection.rollback()
        connection.execute(text("SELECT pg_advisory_unlock_shared(:key)"), {"key": LOCK})
    assert collector.collect() is not None
