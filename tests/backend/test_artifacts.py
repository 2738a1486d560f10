"""Bytes by their hash, in a folder or a bucket; of them only what nothing refers to is removed."""

import hashlib
import io
import os
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import boto3
import pytest
from moto.server import ThreadedMotoServer
from sqlalchemy import text
from support.jobs import attach, execute

from buildarena_backend.artifacts import garbage_collector
from buildarena_backend.artifacts.garbage_collector import LOCK, GarbageCollector
from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.artifacts.uploads import Uploads
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError
from buildarena_backend.process.context import open_context
from buildarena_backend.settings import load_settings

DAY_S = 86_400
KEEP = timedelta(days=7)


def test_bytes_come_back_by_their_hash_and_damage_is_noticed(tmp_path) -> None:
    store = ArtifactStore(tmp_path / "a")
    info = store.put(b"machine", "application/json")
    assert store.put(b"machine", "application/json") == info
    assert (store.get(info.hash), info.size) == (b"machine", 7)
    (tmp_path / "a" / info.hash[:2] / info.hash).write_bytes(b"machinf")
    with pytest.raises(ArtifactDamagedError, match="damaged"):
        store.get(info.hash)
    for name in ("0" * 64, "../../etc/passwd", "", "A" * 64, "a" * 63):
        with pytest.raises(ArtifactMissingError):
            store.get(name)


@pytest.fixture
def bucket(monkeypatch) -> Iterator[object]:
    """A bucket `arena` of an S3-compatible store, spoken to over real HTTP."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    url = "http://{}:{}".format(*server.get_host_and_port())
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    for name in ("AWS_REGION", "AWS_DEFAULT_REGION"):
        monkeypatch.setenv(name, "us-east-1")
    monkeypatch.setenv("AWS_ENDPOINT", url)
    monkeypatch.setenv("AWS_ALLOW_HTTP", "true")
    client = boto3.client("s3", endpoint_url=url)
    client.create_bucket(Bucket="arena")
    yield client
    client.close()
    server.stop()


@pytest.mark.ci
def test_a_bucket_gives_bytes_back_and_loss_is_noticed(
    context, bucket, monkeypatch, tmp_path
) -> None:
    store = ArtifactStore("s3://arena/artifacts")
    kept = store.put(b"a bridge", "application/json")
    assert kept.hash == hashlib.sha256(b"a bridge").hexdigest()
    assert store.get(kept.hash) == b"a bridge"
    key = f"artifacts/{kept.hash[:2]}/{kept.hash}"
    assert [item["Key"] for item in bucket.list_objects_v2(Bucket="arena")["Contents"]] == [key]
    bucket.put_object(Bucket="arena", Key=key, Body=b"a bridgf")
    with pytest.raises(ArtifactDamagedError, match="damaged"):
        store.get(kept.hash)
    bucket.delete_object(Bucket="arena", Key=key)
    with pytest.raises(ArtifactMissingError, match="is not in the store"):
        store.get(kept.hash)
    # Credentials may stand in files.
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        (tmp_path / name).write_text("test\n")
        monkeypatch.setenv(f"{name}_FILE", str(tmp_path / name))
        monkeypatch.delenv(name)
    # Without credentials the store is asked for some at an address of the cloud, which takes long.
    monkeypatch.setenv("AWS_METADATA_ENDPOINT", "http://127.0.0.1:9")
    given = context.settings.model_dump() | {"artifacts_url": "s3://arena/artifacts"}
    with closing(open_context(load_settings(**given))) as own:
        assert own.artifacts.put(b"a bridge", "application/json") == kept
        uploads = Uploads("s3://arena/artifacts", own.settings.artifact_options)
    uploads.keep(("job_0a", 1), "a" * 64, io.BytesIO(b"a file"))
    assert uploads.leases() == {("job_0a", 1)}


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


def refer(context, job: str, digest: str) -> None:
    """A job refers to bytes that are in the trash, or on their way there."""
    values = {"job": job, "hash": digest}
    execute(context, "INSERT INTO artifacts VALUES (:hash, 'text/plain', 5)", values)
    execute(context, "INSERT INTO job_artifacts VALUES (:job, 'machine', :hash)", values)


def test_only_old_unreferenced_bytes_go_and_after_the_trash(
    context, add, collector, folder, monkeypatch
) -> None:
    (job,) = add(1)
    kept = [attach(context, job, {"machine": b"a bridge"})["machine"]]
    kept += [context.artifacts.put(data, "text/plain").hash for data in (b"built", b"moved")]
    execute(
        context,
        "INSERT INTO rollouts (job_id, number, final, engine, machine_hash, trajectory_hash)"
        " VALUES (:job, 0, true, 'mujoco', :machine, :moved)",
        {"job": job, "machine": kept[1], "moved": kept[2]},
    )
    orphan = context.artifacts.put(b"an upload that was broken off", "text/plain").hash
    strange = [folder / "probe/abc", folder / "ab/short", folder / "notes.txt"]
    for file in strange:
        file.parent.mkdir(exist_ok=True)
        file.write_text("mine")
    age(folder, 8)
    young = context.artifacts.put(b"its row is not committed yet", "text/plain").hash
    said = collector.collect(dry_run=True)
    done = collector.collect()
    assert said == done
    assert (done.in_use, done.young, done.trashed, done.deleted) == (3, 1, 1, 0)
    assert done.trashed_bytes == len(b"an upload that was broken off")
    assert all(context.artifacts.get(each) for each in (*kept, young))
    with pytest.raises(ArtifactMissingError):
        context.artifacts.get(orphan)
    monkeypatch.setattr(garbage_collector, "PREFIXES", {orphan[:2]})  # all take a second
    assert collector.collect().deleted == 0  # the trash counts from the move
    age(folder / "trash", 8)
    assert collector.collect().deleted == 1
    assert not list((folder / "trash").rglob(orphan))
    assert all(file.exists() for file in strange)


def test_what_is_referred_to_again_comes_back(context, add, collector, folder, monkeypatch) -> None:
    first, second = add(1, 2)
    datas = (b"the same bridge", b"raced")
    # All parts of the store take a second; the test above goes through them.
    parts = {hashlib.sha256(data).hexdigest()[:2] for data in datas}
    monkeypatch.setattr(garbage_collector, "PREFIXES", parts)
    digest = context.artifacts.put(datas[0], "text/plain").hash
    age(folder, 8)
    assert collector.collect().trashed == 1
    refer(context, first, digest)
    age(folder, 30)
    assert collector.collect().taken_back == 1
    assert context.artifacts.get(digest) == b"the same bridge"
    raced = context.artifacts.put(datas[1], "text/plain").hash
    age(folder, 8)
    move = context.artifacts.trash

    def and_somebody_refers(_: object, found: str) -> None:
        move(found)
        refer(context, second, found)

    monkeypatch.setattr(type(context.artifacts), "trash", and_somebody_refers)
    assert collector.collect().trashed == 0
    assert context.artifacts.get(raced) == b"raced"


def test_collection_waits_for_nobody_and_a_backup_holds_it_off(context, collector) -> None:
    with context.store.database.engine.connect() as connection:
        connection.execute(text("SELECT pg_advisory_lock_shared(:key)"), {"key": LOCK})
        assert collector.collect() is None
        connection.rollback()
        connection.execute(text("SELECT pg_advisory_unlock_shared(:key)"), {"key": LOCK})
    assert collector.collect() is not None
