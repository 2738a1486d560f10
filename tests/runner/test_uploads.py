"""Files come in pieces, each once, and are what their hash says."""

import hashlib
import os

import pytest
from sqlalchemy import text
from support.servers.runner_rig import Caller, runner_key, waiting

from buildarena_api.runners.outcomes import drop_dead_uploads
from buildarena_store import UploadedFile, UploadError, Uploads, uploads

PIECE = uploads.PIECE_BYTES
LEASE = ("job_0a", 3)


@pytest.fixture
def store(tmp_path) -> Uploads:
    return Uploads(tmp_path)


def file_of(data: bytes) -> UploadedFile:
    return UploadedFile(sha256=hashlib.sha256(data).hexdigest(), size=len(data))


def pieces(data: bytes) -> list[tuple[int, bytes]]:
    return [(at, data[at : at + PIECE]) for at in range(0, len(data), PIECE)]


@pytest.mark.parametrize("size", [0, 1, PIECE - 1, PIECE, PIECE + 1, 2 * PIECE, 2 * PIECE + 5])
def test_a_file_is_received_in_pieces_however_often_each_comes(store, size) -> None:
    data = os.urandom(size)
    file = file_of(data)
    assert store.offset(LEASE, file) == 0
    for at, piece in pieces(data) or [(0, b"")]:
        for _ in range(2):
            assert store.append(LEASE, file, at, piece) == at + len(piece)
    assert store.take(LEASE, file) == data
    store.drop(LEASE)
    assert store.leases() == set()
    with pytest.raises(UploadError, match="only 0 of" if size else "not all"):
        store.take(LEASE, file)


@pytest.mark.parametrize(
    ("offset", "length", "says"),
    [
        (PIECE, PIECE, "0 bytes were received: go on there"),
        (1, PIECE - 1, "pieces begin at multiples"),
        (4 * PIECE, 0, "no piece"),
        (0, PIECE - 1, "has 1,048,576, not 1,048,575"),
        (0, PIECE + 1, "has 1,048,576, not 1,048,577"),
        (0, 0, "has 1,048,576, not 0"),
    ],
)
def test_pieces_that_do_not_fit_are_refused(store, offset, length, says) -> None:
    file = file_of(bytes(2 * PIECE + 7))
    with pytest.raises(UploadError, match=says):
        store.append(LEASE, file, offset, bytes(length))
    assert store.leases() == set()


def test_other_bytes_than_the_hash_says_are_to_be_sent_again(store) -> None:
    data = os.urandom(PIECE + 3)
    file = file_of(data)
    for at, piece in pieces(data[::-1]):
        store.append(LEASE, file, at, piece)
    with pytest.raises(UploadError, match="send it again"):
        store.take(LEASE, file)
    for at, piece in pieces(data):
        store.append(LEASE, file, at, piece)
    assert store.take(LEASE, file) == data


def test_what_is_uploaded_under_a_lease_is_bounded(store, monkeypatch) -> None:
    monkeypatch.setattr(uploads, "MAX_FILE_BYTES", 10)
    monkeypatch.setattr(uploads, "MAX_LEASE_BYTES", 25)
    monkeypatch.setattr(uploads, "MAX_LEASE_FILES", 3)
    with pytest.raises(UploadError, match="at most 10 bytes"):
        store.append(LEASE, file_of(bytes(11)), 0, bytes(11))
    for fill in (b"a", b"b"):
        store.append(LEASE, file_of(fill * 10), 0, fill * 10)
    with pytest.raises(UploadError, match="at most 25 bytes"):
        store.append(LEASE, file_of(b"c" * 10), 0, b"c" * 10)
    store.append(LEASE, file_of(b"d"), 0, b"d")
    with pytest.raises(UploadError, match="at most 3 files"):
        store.append(LEASE, file_of(b"e"), 0, b"e")
    store.append(("job_0a", 4), file_of(b"e"), 0, b"e")  # another lease has its own
    assert store.leases() == {LEASE, ("job_0a", 4)}


def test_uploads_of_dead_leases_are_removed(context, url) -> None:
    waiting(context)
    waiting(context, seed=1)
    caller = Caller(url, runner_key(context)[1])
    dead = caller.lease()
    caller.name = "another"
    live = caller.lease()
    for lease in (dead, live):
        caller.upload(lease, b"half a trial")
    with context.store.database.transaction() as connection:
        connection.execute(
            text("UPDATE jobs SET lease_token = lease_token + 1 WHERE id = :id"),
            {"id": dead["job_id"]},
        )
    kept = Uploads(context.settings.artifacts_location)
    assert drop_dead_uploads(context, kept) == 1
    assert kept.leases() == {(live["job_id"], live["token"])}


def test_an_ended_lease_leaves_no_upload(context, url) -> None:
    waiting(context)
    caller = Caller(url, runner_key(context)[1])
    lease = caller.lease()
    caller.upload(lease, b"something")
    caller.ask("POST", caller.at(lease, "/hand-back"))
    assert Uploads(context.settings.artifacts_location).leases() == set()


def test_requests_for_uploads_are_bounded(context, url) -> None:
    waiting(context)
    caller = Caller(url, runner_key(context)[1])
    lease = caller.lease()
    path = caller.at(lease, f"/uploads/{'a' * 64}")
    for wrong in (
        {"size": uploads.MAX_FILE_BYTES + 1, "offset": 0},
        {"size": -1, "offset": 0},
        {"size": 5},
        {"size": 5, "offset": -1},
    ):
        assert caller.ask("PUT", path, params=wrong, content=b"x").status_code == 422
    large = caller.ask("PUT", path, params={"size": 9 << 20, "offset": 0}, content=bytes(5 << 20))
    assert large.status_code == 413
    # Bytes that look like deep JSON are bytes.
    brackets = b"[" * 1000
    digest = hashlib.sha256(brackets).hexdigest()
    sent = caller.ask(
        "PUT",
        caller.at(lease, f"/uploads/{digest}"),
        params={"size": 1000, "offset": 0},
        content=brackets,
    )
    assert sent.json() == {"offset": 1000, "whole": True}
    for sha256 in ("A" * 64, "a" * 63, "a" * 65, "..%2f" + "a" * 60, "g" * 64):
        answer = caller.ask("GET", caller.at(lease, f"/uploads/{sha256}"), params={"size": 1})
        assert answer.status_code == 404, sha256
