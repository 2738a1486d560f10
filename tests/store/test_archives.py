"""A sweep out of one service and into another."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import text
from working import work

from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_pipeline.runtime.context import Context
from buildarena_store import ArtifactStore, UnknownIdError, archives
from buildarena_store.archives import ArchiveError, read_archive, write_archive
from buildarena_store.tables import metadata
from buildarena_worker.wiring import verifier

SPEC = SweepSpec(
    tasks=["lift-1"], models=["builtin/expert"], seeds=[0, 1], simulator="mujoco", name="moved"
)


@pytest.fixture
def elsewhere(context, tmp_path) -> Callable[[], Context]:
    """Another service: an empty database and an empty artifact folder."""

    def move() -> Context:
        names = ", ".join(table.name for table in metadata.sorted_tables)
        with context.store.database.transaction() as connection:
            connection.execute(text(f"TRUNCATE {names} RESTART IDENTITY CASCADE"))
        return replace(context, artifacts=ArtifactStore(tmp_path / "other"))

    return move


@pytest.fixture
def archive(context, submissions, tmp_path) -> tuple[str, Path]:
    """An archive of a finished sweep."""
    sweep_id = submissions.submit_sweep(SPEC).sweep.id
    work(context)
    target = tmp_path / "sweep.zip"
    write_archive(context.store.database, context.artifacts, sweep_id, target)
    return sweep_id, target


def test_a_sweep_arrives_whole_and_can_be_verified_there(context, archive, elsewhere) -> None:
    sweep_id, file = archive
    before = context.store.jobs.page(limit=10, sweep_id=sweep_id)
    journals = {job.id: context.store.journal.read(job.id) for job in before}
    other = elsewhere()
    done = read_archive(other.store.database, other.artifacts, file, owner="key_k")
    assert (done.sweep_id, done.jobs, done.added) == (sweep_id, 2, 2)
    after = other.store.jobs.page(limit=10, sweep_id=sweep_id)
    assert after == [replace(job, owner="key_k", payer=sweep_id) for job in before]
    assert {job.id: other.store.journal.read(job.id) for job in after} == journals
    assert other.store.sweeps.progress(sweep_id).outcomes == {"success": 2}
    report = verifier(other).verify(after[0].id)
    assert report["ok"], report


def test_taking_in_twice_changes_nothing(context, archive) -> None:
    sweep_id, file = archive
    before = context.store.jobs.page(limit=10)
    assert read_archive(context.store.database, context.artifacts, file, owner="other").added == 0
    assert context.store.jobs.page(limit=10) == before
    assert context.store.sweeps.get(sweep_id).owner is None


def test_an_unfinished_sweep_goes_on_elsewhere_from_its_journals(
    context, submissions, elsewhere, tmp_path
) -> None:
    sweep_id = submissions.submit_sweep(SPEC).sweep.id
    work(context, steps=1)
    asked = {job.id: job.requests for job in context.store.jobs.page(limit=10)}
    assert sum(asked.values()) > 0
    write_archive(context.store.database, context.artifacts, sweep_id, tmp_path / "half.zip")
    other = elsewhere()
    read_archive(other.store.database, other.artifacts, tmp_path / "half.zip")
    assert other.store.sweeps.get(sweep_id).state == "paused"
    assert {job.state for job in other.store.jobs.page(limit=10)} == {"on_hold"}
    submissions.resume(sweep_id, None)
    work(other)
    after = other.store.jobs.page(limit=10)
    assert {job.outcome for job in after} == {"success"}
    built = [job for job in after if asked[job.id]]
    assert [job.requests for job in built] == [asked[job.id] for job in built]


def changed(file: Path, name: str, change: Callable[[bytes], bytes | None]) -> Path:
    """A copy of the archive with one member changed, or left out."""
    target = file.with_name("changed.zip")
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(target, "w") as out:
        for member in source.namelist():
            data = source.read(member)
            kept = change(data) if member.startswith(name) else data
            if kept is not None:
                out.writestr(member, kept)
    return target


@pytest.mark.parametrize(
    ("member", "change", "said"),
    [
        ("artifacts/", lambda data: data + b" ", "was changed"),
        ("artifacts/", lambda _: None, "its artifacts do not match its rows"),
        ("rows/jobs", lambda data: data.replace(b'"seed": 0', b'"seed": 7'), "was changed"),
        ("rows/jobs", lambda data: data.replace(b'"seed"', b'"seeed"'), "this program's columns"),
        (
            "rows/journal",
            lambda data: data.replace(b'"job_', b'"jab_').replace(b"jab_id", b"job_id"),
            "not in the archive",
        ),
        ("rows/jobs", lambda data: data.replace(b'"faults": 0', b'"faults": "x"'), "a value"),
        ("rows/jobs", lambda _: b"{", "not a valid archive"),
        ("rows/jobs", lambda _: b"[1]\n", "this program's columns"),
        ("rows/sweeps", lambda _: b"", "not a valid archive"),
        ("manifest", lambda _: None, "not a valid archive"),
        ("manifest", lambda data: data.replace(b'"format": 1', b'"format": 9'), "format 9"),
    ],
)
def test_a_changed_archive_is_refused_whole(archive, elsewhere, member, change, said) -> None:
    _, file = archive
    other = elsewhere()
    with pytest.raises(ArchiveError, match=said):
        read_archive(other.store.database, other.artifacts, changed(file, member, change))
    assert other.store.jobs.page(limit=10) == []
    assert other.store.sweeps.page(limit=10) == []


def test_names_that_leave_the_archive_are_refused(archive, elsewhere, tmp_path) -> None:
    _, file = archive
    with zipfile.ZipFile(file, "a") as out:
        out.writestr("artifacts/../../../../tmp/evil", b"x")
        out.writestr("/etc/evil", b"x")
    other = elsewhere()
    # Members with other names are never opened.
    assert read_archive(other.store.database, other.artifacts, file).added == 2
    assert not list(tmp_path.rglob("evil"))


def test_a_bomb_is_not_unpacked(archive, elsewhere, monkeypatch) -> None:
    _, file = archive
    monkeypatch.setattr(archives, "LARGEST_MEMBER", 1000)
    other = elsewhere()
    with pytest.raises(ArchiveError, match="larger than 1,000 bytes"):
        read_archive(other.store.database, other.artifacts, file)


def test_what_is_no_archive_is_refused(context, tmp_path) -> None:
    (tmp_path / "x.zip").write_bytes(b"PK nonsense")
    with pytest.raises(ArchiveError, match="not a valid archive"):
        read_archive(context.store.database, context.artifacts, tmp_path / "x.zip")
    with pytest.raises(UnknownIdError, match="sweep_x"):
        write_archive(context.store.database, context.artifacts, "sweep_x", tmp_path / "y.zip")


def test_the_archive_is_plain_json_and_files(archive) -> None:
    _, file = archive
    with zipfile.ZipFile(file) as opened:
        names = opened.namelist()
        jobs = [json.loads(line) for line in opened.read("rows/jobs.jsonl").splitlines()]
    assert [job["outcome"] for job in jobs] == ["success", "success"]
    assert sum(name.startswith("artifacts/") for name in names) >= 4
