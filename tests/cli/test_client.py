"""What commands say to a server that is not BuildArena, breaks off, or is none at all."""

import pytest
from support.servers.wrong_server import answer, wrong_server

from buildarena_cli.client import Client, RefusedError, UnreachableError
from buildarena_cli.errors import CommandError

HTML = answer(200, b"<html>")
SHORT = b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nPK"
MOVED = answer(302, Location="http://127.0.0.1:1/")
WHOLE = answer(200, b"PK01")


def test_what_is_no_answer_of_an_api_is_one_sentence(subtests) -> None:
    for said, error, says in [
        (HTML, CommandError, "does not answer in JSON"),
        (SHORT, UnreachableError, "no BuildArena answers"),
        (MOVED, RefusedError, "HTTP 302"),
        (b"SSH-2.0-OpenSSH\r\n", UnreachableError, "no BuildArena answers"),
        (b"", UnreachableError, "no BuildArena answers"),
    ]:
        with (
            subtests.test(said=said),
            wrong_server(said) as server,
            pytest.raises(error, match=says),
        ):
            Client(server.url).get("/v1/jobs")


def test_a_download_is_there_whole_or_not_at_all(tmp_path) -> None:
    target = tmp_path / "sweep.zip"
    with wrong_server(SHORT) as server, pytest.raises(UnreachableError):
        Client(server.url).download("/v1/x", target)
    assert not target.exists()
    with wrong_server(WHOLE) as server:
        Client(server.url).download("/v1/x", target)
        with pytest.raises(FileNotFoundError):
            Client(server.url).download("/v1/x", tmp_path / "no" / "folder")
    assert target.read_bytes() == b"PK01"


def test_parameters_and_keys_are_sent_as_the_api_reads_them() -> None:
    with wrong_server(HTML) as server, pytest.raises(CommandError):
        Client(server.url, key="secret").get(
            "/v1/jobs", task=["a b", "c&d"], flagged=True, model=None
        )
    head = server.received[0].decode()
    assert head.startswith("GET /v1/jobs?task=a+b&task=c%26d&flagged=true HTTP/1.1\r\n")
    assert "Authorization: Bearer secret\r\n" in head


def test_what_is_no_url_is_refused(subtests) -> None:
    for url in ["ftp://x", "nonsense", "http://", "http://x:99999", "http://[", ""]:
        with subtests.test(url=url), pytest.raises(CommandError, match="is not the URL of an API"):
            Client(url)


def test_what_is_no_key_is_refused_unseen() -> None:
    with pytest.raises(CommandError, match="BUILDARENA_KEY is not a key") as refused:
        Client("http://127.0.0.1:1", key="secret\r\nHost: x")
    assert "secret" not in str(refused.value)
