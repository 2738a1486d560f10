"""What commands say to a server that is not BuildArena, breaks off, or is none at all."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from buildarena_cli.client import Client, RefusedError, UnreachableError
from buildarena_cli.errors import CommandError

HTML = b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: 6\r\n\r\n<html>"
SHORT = b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nPK"
MOVED = b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n"
WHOLE = b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nPK01"


@contextmanager
def answering(answer: bytes) -> Iterator[tuple[str, list[bytes]]]:
    """The URL of a server with one answer, and what it was sent."""
    received: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                with connection:
                    received.append(connection.recv(65536))
                    connection.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"http://127.0.0.1:{server.getsockname()[1]}", received
        server.shutdown(socket.SHUT_RDWR)
    thread.join()


@pytest.mark.parametrize(
    ("answer", "error", "says"),
    [
        (HTML, CommandError, "does not answer in JSON"),
        (SHORT, UnreachableError, "no BuildArena answers"),
        (MOVED, RefusedError, "HTTP 302"),
        (b"SSH-2.0-OpenSSH\r\n", UnreachableError, "no BuildArena answers"),
        (b"", UnreachableError, "no BuildArena answers"),
    ],
)
def test_what_is_no_answer_of_an_api_is_one_sentence(answer, error, says) -> None:
    with answering(answer) as (url, _), pytest.raises(error, match=says):
        Client(url).get("/v1/jobs")


def test_a_download_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "sweep.zip"
    with answering(SHORT) as (url, _), pytest.raises(UnreachableError):
        Client(url).download("/v1/x", target)
    assert not target.exists()
    with answering(WHOLE) as (url, _):
        Client(url).download("/v1/x", target)
        with pytest.raises(FileNotFoundError):
            Client(url).download("/v1/x", tmp_path / "no" / "folder")
    assert target.read_bytes() == b"PK01"


def test_parameters_and_keys_are_sent_as_the_api_reads_them() -> None:
    with answering(HTML) as (url, received), pytest.raises(CommandError):
        Client(url, key="secret").get("/v1/jobs", task=["a b", "c&d"], flagged=True, model=None)
    head = received[0].decode()
    assert head.startswith("GET /v1/jobs?task=a+b&task=c%26d&flagged=true HTTP/1.1\r\n")
    assert "Authorization: Bearer secret\r\n" in head


@pytest.mark.parametrize(
    "url", ["ftp://x", "nonsense", "http://", "http://x:99999", "http://[", ""]
)
def test_what_is_no_url_is_refused(url) -> None:
    with pytest.raises(CommandError, match="is not the URL of an API"):
        Client(url)


def test_what_is_no_key_is_refused_unseen() -> None:
    with pytest.raises(CommandError, match="BUILDARENA_KEY is not a key") as refused:
        Client("http://127.0.0.1:1", key="secret\r\nHost: x")
    assert "secret" not in str(refused.value)
