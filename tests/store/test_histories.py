"""Histories leave the tables and come back as they were, to the byte."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import text
from support.jobs import execute
from support.stages import work

from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_pipeline.runtime.context import Context
from buildarena_store import ArtifactMissingError
from buildarena_store.archives import write_archive
from buildarena_store.jobs.histories import PACKED, Histories
from buildarena_worker.wiring import verifier

pytestmark = pytest.mark.nightly

SWEEP = {
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/random"],
    "seeds": [0],
    "simulator": "mujoco",
}
NOW = timedelta(0)


@pytest.fixture
def histories(context: Context, submissions) -> Histories:
    """Two jobs have been scored."""
    submissions.submit_sweep(SweepSpec.model_validate(SWEEP))
    work(context)
    return Histories(context.store.database, context.artifacts)


def rows(context: Context) -> dict[str, list[str]]:
    with context.store.database.transaction() as connection:
        return {
            table.name: [
                str(row[0])
                for row in connection.execute(
                    text(f"SELECT t::text FROM {table.name} t WHERE job_id IS NOT NULL ORDER BY 1")
                )
            ]
            for table in PACKED
        }


def ids(context: Context) -> list[str]:
    return sorted(job.id for job in context.store.jobs.page(limit=10))


def test_packed_rows_are_gone_and_come_back_as_they_were(context, histories) -> None:
    before = rows(context)
    assert before["journal"]
    assert before["events"]
    assert histories.waiting(NOW) == 2
    done = list(histories.pack_all(NOW))
    assert sum(one.jobs for one in done) == 2
    assert sum(one.rows for one in done) == sum(map(len, before.values()))
    assert rows(context) == {"journal": [], "external_calls": [], "events": []}
    assert histories.waiting(NOW) == 0
    assert histories.unpack(ids(context)) == 2
    assert rows(context) == before
    assert histories.unpack(ids(context)) == 0
    assert rows(context) == before


def test_two_that_pack_at_once_share_the_work(context, histories) -> None:
    before = rows(context)

    def packed(_: int) -> int:
        return sum(one.jobs for one in histories.pack_all(NOW))

    with ThreadPoolExecutor(2) as threads:
        assert sum(threads.map(packed, range(2))) == 2
    assert not any(rows(context).values())
    assert histories.unpack(ids(context)) == 2
    assert rows(context) == before


def test_a_packed_job_is_still_verified_and_read(context, histories) -> None:
    boards = context.store.results.boards
    track = boards.tracks()[0]
    before = boards.changes(track)
    list(histories.pack_all(NOW))
    assert boards.changes(track) == before
    for job_id in ids(context):
        report = verifier(context).verify(job_id).as_document()
        assert report["ok"], report
    assert rows(context)["journal"]


def test_young_and_errored_jobs_and_those_under_verification_keep_their_rows(
    context, histories
) -> None:
    before = rows(context)
    assert list(histories.pack_all(timedelta(days=1))) == []
    first, second = ids(context)
    execute(context, "UPDATE jobs SET outcome = 'errored' WHERE id = :id", {"id": first})
    context.store.verifications.request([second], owner=None)
    assert histories.waiting(NOW) == 0
    assert list(histories.pack_all(NOW)) == []
    assert rows(context) == before


def test_a_store_that_fails_costs_nothing(context, histories, monkeypatch) -> None:
    before = rows(context)

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(type(context.artifacts), "put", full)
    with pytest.raises(OSError, match="no space"):
        list(histories.pack_all(NOW))
    assert rows(context) == before


def test_a_history_that_is_lost_is_named_and_leaves_its_job_alone(context, histories) -> None:
    list(histories.pack_all(NOW))
    folder = Path(context.settings.data) / "artifacts"
    job_id = ids(context)[0]
    digest = context.store.jobs.artifacts(job_id)["history"]
    (folder / digest[:2] / digest).unlink()
    with pytest.raises(ArtifactMissingError, match=digest):
        histories.unpack([job_id])
    assert context.store.jobs.artifacts(job_id)["history"] == digest
    assert not verifier(context).verify(job_id).as_document()["ok"]


def test_an_archive_of_packed_jobs_is_whole(context, histories, tmp_path) -> None:
    sweep = context.store.sweeps.page(limit=1)[0].id
    write_archive(context.store.database, context.artifacts, sweep, tmp_path / "before.zip")
    list(histories.pack_all(NOW))
    write_archive(context.store.database, context.artifacts, sweep, tmp_path / "after.zip")
    members = [_members(tmp_path / name) for name in ("before.zip", "after.zip")]
    assert members[0] == members[1]


def _members(file: Path) -> dict[str, bytes]:
    import zipfile

    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist() if name != "manifest.json"}
