"""A sweep out of one service and into another."""

import json
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support.jobs import attach, execute
from support.servers.databases import empty
from support.stages import work

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_benchmark import parse_custom_task
from buildarena_benchmark.leaderboard import summarise
from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_pipeline.runtime.context import Context
from buildarena_store import (
    ArtifactStore,
    JobKey,
    NameTakenError,
    TrialFilter,
    UnknownIdError,
    archives,
)
from buildarena_store.archives import ArchiveError, Imported, members, rows, write_archive
from buildarena_store.archives.writing import NOT_OF_JOBS
from buildarena_store.artifacts.kinds import EVIDENCE
from buildarena_store.jobs.job import configuration_hash
from buildarena_store.tables import metadata
from buildarena_worker.wiring import verification_runner, verifier

pytestmark = pytest.mark.nightly

SPEC = SweepSpec(
    tasks=["lift-1"], models=["builtin/expert"], seeds=[0, 1], simulator="mujoco", name="moved"
)


def read_archive(context: Context, file: Path, owner: str | None = None) -> Imported:
    """Imports a file as the API does."""
    return archives.read_archive(
        context.store.database,
        context.artifacts,
        file,
        check_spec=SweepSpec.model_validate,
        owner=owner,
    )


@pytest.fixture
def elsewhere(context, tmp_path) -> Callable[[], Context]:
    """Another service: an empty database and an empty artifact folder."""

    def move() -> Context:
        empty(context.store.database)
        return replace(context, artifacts=ArtifactStore(tmp_path / "other"))

    return move


@pytest.fixture
def played(context, submissions, tmp_path) -> tuple[str, Path]:
    """A finished sweep and its archive."""
    sweep_id = submissions.submit_sweep(SPEC).sweep.id
    work(context)
    target = tmp_path / "sweep.zip"
    write_archive(context.store.database, context.artifacts, sweep_id, target)
    return sweep_id, target


@pytest.fixture(scope="module")
def kept() -> list[tuple[str, bytes]]:
    """The archive of the first sweep that was played."""
    return []


@pytest.fixture
def archive(request, kept, tmp_path) -> tuple[str, Path]:
    """The archive of a finished sweep, which need not be here any more."""
    if not kept:
        sweep_id, file = request.getfixturevalue("played")
        kept.append((sweep_id, file.read_bytes()))
    sweep_id, content = kept[0]
    file = tmp_path / "sweep.zip"
    file.write_bytes(content)
    return sweep_id, file


def test_a_sweep_arrives_whole_and_can_be_verified_there(context, played, elsewhere) -> None:
    sweep_id, file = played
    before = context.store.jobs.page(limit=10, sweep_id=sweep_id)
    journals = {job.id: context.store.journal.read(job.id) for job in before}
    other = elsewhere()
    done = read_archive(other, file, owner="key_k")
    assert (done.sweep_id, done.jobs, done.added) == (sweep_id, 2, 2)
    after = other.store.jobs.page(limit=10, sweep_id=sweep_id)
    origin = after[0].imported_from
    assert origin is not None
    assert sweep_id in origin
    assert after == [
        replace(job, owner="key_k", payer=sweep_id, imported_from=origin, audit="required")
        for job in before
    ]
    assert {job.id: other.store.journal.read(job.id) for job in after} == journals
    assert other.store.sweeps.progress(sweep_id).outcomes == {"success": 2}
    report = verifier(other).verify(after[0].id).as_document()
    assert report["ok"], report


def test_pictures_and_evidence_arrive_too(context, played, elsewhere, tmp_path) -> None:
    sweep_id, _ = played
    job = context.store.jobs.page(limit=1, sweep_id=sweep_id)[0].id
    made = {
        f"log-0-{n}.{end}": (end.encode(), kind) for n, (end, kind) in enumerate(EVIDENCE.items())
    }
    made["thumbnail"] = (b"drawn", EVIDENCE["png"])
    for name, (data, kind) in made.items():
        attach(context, job, {name: data}, kind)
    again = tmp_path / "again.zip"
    write_archive(context.store.database, context.artifacts, sweep_id, again)
    other = elsewhere()
    assert read_archive(other, again).added == 2
    files = {file.name: file for file in other.store.jobs.files(job)}
    for name, (data, kind) in made.items():
        assert (other.artifacts.get(files[name].hash), files[name].media_type) == (data, kind)


def test_taking_in_twice_changes_nothing(context, played) -> None:
    sweep_id, file = played
    before = context.store.jobs.page(limit=10)
    assert read_archive(context, file, owner="other").added == 0
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
    read_archive(other, tmp_path / "half.zip")
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
    target = file.with_name(f"{file.stem}-changed.zip")
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
        ("rows/jobs", lambda data: data.replace(b'"seed"', b'"seeed"'), "seeed: Extra inputs"),
        (
            "rows/journal",
            lambda data: data.replace(b'"job_', b'"jab_').replace(b"jab_id", b"job_id"),
            "job_id: String should match",
        ),
        ("rows/jobs", lambda data: data.replace(b'"faults": 0', b'"faults": "x"'), "faults: Input"),
        ("rows/jobs", lambda _: b"{", "row 1 of jobs: Invalid JSON"),
        ("rows/jobs", lambda _: b"[" * 100_000, "row 1 of jobs: Invalid JSON"),
        ("rows/jobs", lambda data: data + data, "is in it twice"),
        ("rows/jobs", lambda _: b"[1]\n", "Input should be an object"),
        ("rows/sweeps", lambda _: b"", "must hold one sweep"),
        ("rows/sweeps", lambda data: data + data, "must hold one sweep"),
        ("manifest", lambda _: None, "not a valid archive"),
        ("manifest", lambda data: data.replace(b'"format": 1', b'"format": 9'), "format 9"),
    ],
)
def test_a_changed_archive_is_refused_whole(archive, elsewhere, member, change, said) -> None:
    _, file = archive
    other = elsewhere()
    with pytest.raises(ArchiveError, match=said):
        read_archive(other, changed(file, member, change))
    assert other.store.jobs.page(limit=10) == []
    assert other.store.sweeps.page(limit=10) == []


def test_names_that_leave_the_archive_are_refused(archive, elsewhere, tmp_path) -> None:
    _, file = archive
    with zipfile.ZipFile(file, "a") as out:
        out.writestr("artifacts/../../../../tmp/evil", b"x")
        out.writestr("/etc/evil", b"x")
    other = elsewhere()
    # Members with other names are never opened.
    assert read_archive(other, file).added == 2
    assert not list(tmp_path.rglob("evil"))


def test_a_bomb_is_not_unpacked(archive, elsewhere, monkeypatch) -> None:
    _, file = archive
    other = elsewhere()
    for bound in ("LARGEST_LINE", "LARGEST_ROWS", "LARGEST_ARTIFACT", "LARGEST_ARTIFACTS"):
        with monkeypatch.context() as patch:
            patch.setattr(members, bound, 1000)
            with pytest.raises(ArchiveError, match=r"larger than|manifest"):
                read_archive(other, file)
    monkeypatch.setattr(members, "MAX_MEMBERS", 5)
    with pytest.raises(ArchiveError, match="more than 5 members"):
        read_archive(other, file)


def test_a_member_that_unpacks_to_gigabytes_is_read_to_its_bound_only(archive, elsewhere) -> None:
    _, file = archive
    bomb = changed(file, "rows/jobs", lambda _: b"0" * (200 << 20))
    other = elsewhere()
    tracemalloc.start()
    with pytest.raises(ArchiveError, match="larger than"):
        read_archive(other, bomb)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4 * members.LARGEST_LINE


def test_what_is_no_archive_is_refused(context, tmp_path) -> None:
    (tmp_path / "x.zip").write_bytes(b"PK nonsense")
    with pytest.raises(ArchiveError, match="not a valid archive"):
        read_archive(context, tmp_path / "x.zip")
    with pytest.raises(UnknownIdError, match="sweep_x"):
        write_archive(context.store.database, context.artifacts, "sweep_x", tmp_path / "y.zip")


def test_the_archive_is_plain_json_and_files(archive) -> None:
    _, file = archive
    with zipfile.ZipFile(file) as opened:
        names = opened.namelist()
        jobs = [json.loads(line) for line in opened.read("rows/jobs.jsonl").splitlines()]
    assert [job["outcome"] for job in jobs] == ["success", "success"]
    assert sum(name.startswith("artifacts/") for name in names) >= 4


# Forged rows: each as it could be in an archive whose ids and hashes are right.


def forge(file: Path, table: str, change: Callable[[dict], object]) -> Path:
    """A copy with the first row of a table changed."""

    def forged(data: bytes) -> bytes:
        first, *others = data.splitlines(keepends=True)
        row = json.loads(first)
        change(row)
        return json.dumps(row).encode() + b"\n" + b"".join(others)

    return changed(file, f"rows/{table}", forged)


def rehashed(row: dict) -> None:
    """Gives a changed job the hash and the id that belong to it."""
    row["model_hash"] = configuration_hash(row["model_config"], row["limits"])
    key = JobKey(**{name: row[name] for name in JobKey.__dataclass_fields__})
    row["id"] = key.job_id


@pytest.mark.parametrize(
    ("table", "values", "said"),
    [
        ("jobs", {"outcome": "champion"}, "outcome: Input should be"),
        ("jobs", {"outcome": "errored"}, "has a score when"),
        ("jobs", {"outcome": "unsuccessful"}, "success and outcome differ"),
        ("jobs", {"success": False}, "success and outcome differ"),
        ("jobs", {"success": 1}, "success: Input should be a valid boolean"),
        ("jobs", {"indicator": float("inf")}, "indicator: Input should be a finite"),
        ("jobs", {"indicator": None}, "has a score when"),
        ("jobs", {"state": "queued"}, "has an outcome and an end"),
        ("jobs", {"state": "DONE"}, "state: Input should be"),
        ("jobs", {"queue": "construct; DROP"}, "queue: String should match"),
        ("jobs", {"flags": ["<script>"]}, "flags.0: String should match"),
        ("jobs", {"reason": "a\n"}, "reason: String should match"),
        ("jobs", {"metrics": {"parts": float("nan")}}, "metrics: nan is not a finite number"),
        ("jobs", {"metrics": {"a\u0000": 1}}, "NUL"),
        ("jobs", {"requests": -1}, "requests: Input should be greater"),
        ("jobs", {"requests": 10**30}, "requests: Input should be less"),
        ("jobs", {"requests": 7}, "requests is not what its journal adds up to"),
        ("jobs", {"cost_usd": "0.5"}, "cost_usd is not what its journal adds up to"),
        ("jobs", {"cost_usd": "-1"}, "cost_usd: Input should be greater"),
        ("jobs", {"cost_usd": "NaN"}, "cost_usd: Input should be a finite"),
        ("jobs", {"created_at": "2999-01-01T00:00:00+00:00"}, "created_at: is in the future"),
        ("jobs", {"finished_at": "2020-01-01T00:00:00"}, "finished_at: Input should have timezone"),
        ("jobs", {"model_hash": "0" * 64}, "was changed"),
        ("jobs", {"limits": {"max_requests": 1}}, "model_hash is not that of"),
        ("jobs", {"model": "gpt-5"}, "model is not the name in its configuration"),
        ("jobs", {"id": "../../x"}, "id: String should match"),
        ("jobs", {"refused_actions": 10**6}, "more actions were refused than made"),
        ("sweeps", {"name": "two\nlines"}, "name: String should match"),
        ("sweeps", {"spec": {"tasks": []}}, "the sweep's spec"),
        ("sweeps", {"spec": "text"}, "spec: Input should be an object"),
        ("sweeps", {"id": "sweep_" + "0" * 20}, "must hold one sweep"),
        ("journal", {"sequence": 3}, "goes on with 3 where 0 is next"),
        ("journal", {"latency_s": -1.0}, "latency_s: Input should be greater"),
        ("journal", {"job_id": "job_" + "0" * 20}, "not in the archive"),
        ("rollouts", {"number": 1}, "goes on with 1 where 0 is next"),
        ("rollouts", {"machine_hash": "0" * 64}, "is not in the archive"),
        ("rollouts", {"trajectory_hash": "../x"}, "trajectory_hash: String should match"),
        ("artifacts", {"media_type": "text/html"}, "choose from application/json"),
        ("artifacts", {"size": 1}, "bytes, not 1"),
        ("job_artifacts", {"name": "../machine"}, "name: String should match"),
        ("job_artifacts", {"hash": "0" * 64}, "is not in the archive"),
        ("attempts", {"worker": "a\u0000"}, "worker: String should match"),
    ],
)
def test_forged_rows_are_refused_and_named(archive, elsewhere, table, values, said) -> None:
    _, file = archive
    other = elsewhere()
    with pytest.raises(ArchiveError, match=said):
        read_archive(other, forge(file, table, lambda row: row.update(values)))
    assert other.store.jobs.page(limit=10) == []
    assert other.store.sweeps.page(limit=10) == []


def test_a_job_under_a_model_that_it_was_not_is_refused(archive, elsewhere) -> None:
    _, file = archive

    def rename(row: dict) -> None:
        row["model"] = "somebody/else"
        rehashed(row)

    with pytest.raises(ArchiveError, match="model is not the name in its configuration"):
        read_archive(elsewhere(), forge(file, "jobs", rename))


def test_a_deep_value_is_refused(archive, elsewhere) -> None:
    _, file = archive
    deep: object = 1
    for _ in range(100):
        deep = [deep]
    with pytest.raises(ArchiveError, match="nested deeper than 64"):
        read_archive(elsewhere(), forge(file, "jobs", lambda row: row.update(metrics={"a": deep})))


def test_every_column_of_every_table_is_checked() -> None:
    kinds = {
        "sweeps": rows.SweepRow,
        "jobs": rows.JobRow,
        "tasks": rows.TaskRow,
        "attempts": rows.AttemptRow,
        "journal": rows.JournalRow,
        "external_calls": rows.ExternalCallRow,
        "rollouts": rows.RolloutRow,
        "artifacts": rows.ArtifactRow,
        "job_artifacts": rows.JobArtifactRow,
    }
    for name, kind in kinds.items():
        fields = {field.alias or given for given, field in kind.model_fields.items()}
        columns = set(metadata.tables[name].columns) - set(NOT_OF_JOBS)
        assert fields == {column.name for column in columns}


# What was imported counts when it was found again here.


def test_imported_scores_count_when_they_were_verified(archive, elsewhere) -> None:
    _, file = archive
    other = elsewhere()
    done = read_archive(other, file)
    assert done.unverified == 2
    waiting = [
        other.store.verifications.get(id_) for id_ in other.store.verifications.to_notify(10)
    ]
    assert {check.job_id for check in waiting} == {j.id for j in other.store.jobs.page(limit=9)}
    boards = other.store.results.boards
    feed, trials = boards.cells.feed(None), boards.trials(TrialFilter())
    assert [(t.imported, t.unverified, t.scored) for t in trials] == [(True, True, False)] * 2
    runner = verification_runner(other)
    assert runner.process_one()
    (changed,) = boards.cells.feed(feed.mark).cells
    (now,) = boards.cells.read([changed.id])
    assert sorted(t.unverified for t in now.tallies if t.scored) == [False]
    board = summarise(boards.trials(TrialFilter()))
    assert (board.trials, board.ended, board.imported, board.unverified) == (1, 1, 2, 1)


def test_a_forged_score_never_counts(archive, elsewhere) -> None:
    _, file = archive
    other = elsewhere()
    better = forge(file, "jobs", lambda row: row.update(indicator=1e6))
    read_archive(other, forge(better, "rollouts", lambda row: row.update(indicator=1e6)))
    while verification_runner(other).process_one():
        pass
    counted = [t.indicator for t in other.store.results.boards.trials(TrialFilter()) if t.scored]
    assert len(counted) == 1
    assert max(counted) < 1e6
    # Asking again does not help.
    (forged,) = [job for job in other.store.jobs.page(limit=9) if job.verified_at is None]
    other.store.verifications.request([forged.id], owner=None)
    assert verification_runner(other).process_one()
    assert other.store.jobs.get(forged.id).verified_at is None


def test_a_sweep_that_is_here_keeps_its_jobs(played, context) -> None:
    sweep_id, file = played
    execute(context, "DELETE FROM sweep_jobs WHERE job_id = (SELECT min(id) FROM jobs)")
    with pytest.raises(ArchiveError, match=f"{sweep_id} is here, with other jobs"):
        read_archive(context, file)


def test_an_imported_version_of_a_task_is_never_the_one_for_new_jobs(
    context, submissions, elsewhere, tmp_path
) -> None:
    old, new = (EXAMPLE.replace("200", load) for load in ("200", "300"))
    context.tasks.add(parse_custom_task(old, origin="t"), old, owner="key_a")
    spec = SweepSpec(tasks=["narrow-gap"], models=["builtin/idle"], seeds=[0])
    sweep_id = submissions.submit_sweep(spec).sweep.id
    work(context)
    write_archive(context.store.database, context.artifacts, sweep_id, tmp_path / "a.zip")
    other = elsewhere()
    ours = parse_custom_task(new, origin="t")
    other.tasks.add(ours, new, owner="key_b")
    read_archive(other, tmp_path / "a.zip", owner="key_c")
    assert other.store.tasks.newest()[0].version == ours.version
    with pytest.raises(NameTakenError):
        other.tasks.add(parse_custom_task(old, origin="t"), old, owner="key_c")
