"""Artifacts in an S3-compatible store, spoken to over real HTTP."""

import hashlib
from collections.abc import Iterator

import boto3
import pytest
from moto.server import ThreadedMotoServer

from buildarena_store import ArtifactDamagedError, ArtifactMissingError, ArtifactStore, Uploads
from buildarena_store.uploads import UploadedFile

pytestmark = pytest.mark.ci


@pytest.fixture
def bucket(monkeypatch) -> Iterator[object]:
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_REGION": "us-east-1",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT": f"http://{host}:{port}",
        "AWS_ALLOW_HTTP": "true",
    }.items():
        monkeypatch.setenv(name, value)
    client = boto3.client("s3", endpoint_url=f"http://{host}:{port}")
    client.create_bucket(Bucket="arena")
    yield client
    client.close()
    server.stop()


def test_bytes_come_back_from_a_bucket(bucket) -> None:
    store = ArtifactStore("s3://arena/artifacts")
    kept = store.put(b"a bridge", "application/json")
    assert kept.hash == hashlib.sha256(b"a bridge").hexdigest()
    assert store.get(kept.hash) == b"a bridge"
    assert store.put(b"a bridge", "application/json") == kept
    keys = [item["Key"] for item in bucket.list_objects_v2(Bucket="arena")["Contents"]]
    assert keys == [f"artifacts/{kept.hash[:2]}/{kept.hash}"]


def test_lost_and_damaged_bytes_are_noticed(bucket) -> None:
    store = ArtifactStore("s3://arena/artifacts")
    kept = store.put(b"a bridge", "application/json")
    key = f"artifacts/{kept.hash[:2]}/{kept.hash}"
    bucket.put_object(Bucket="arena", Key=key, Body=b"a bridgf")
    with pytest.raises(ArtifactDamagedError, match="damaged"):
        store.get(kept.hash)
    bucket.delete_object(Bucket="arena", Key=key)
    with pytest.raises(ArtifactMissingError, match="is not in the store"):
        store.get(kept.hash)


@pytest.mark.usefixtures("bucket")
def test_uploads_take_credentials_that_stand_in_no_variable(monkeypatch) -> None:
    options = dict.fromkeys(("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"), "test")
    for name in options:
        monkeypatch.delenv(name)
    # Without credentials the store is asked for some at an address of the cloud, which takes long.
    monkeypatch.setenv("AWS_METADATA_ENDPOINT", "http://127.0.0.1:9")
    data = b"a piece"
    file = UploadedFile(sha256=hashlib.sha256(data).hexdigest(), size=len(data))
    uploads = Uploads("s3://arena/artifacts", options)
    assert uploads.append(("job_0a", 1), file, 0, data) == len(data)
    assert uploads.leases() == {("job_0a", 1)}
