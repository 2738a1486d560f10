"""Servers that refuse, are busy, break off, or are none of ours: what both clients make of it."""

from __future__ import annotations

import inspect
import json
import time
import traceback
from itertools import product
from typing import Any

import pytest
from wrong_server import answer, wrong_server

from buildarena_client import (
    BadArgumentError,
    Client,
    ClientError,
    DamagedError,
    NotAnApiError,
    Patience,
    RefusedError,
    ServiceFaultError,
    TimedOutError,
    TooManyRequestsError,
    UnavailableError,
    UnreachableError,
)
from buildarena_client.patience import BREAK_PAUSE_S

SECRET = "ba_secret-that-nobody-sees"
JOB = "job_0a1b2c3d4e5f60718293"
SWEEP = "sweep_0a1b2c3d4e5f60718293"
SPEC = {"tasks": ["lift-1"], "models": ["builtin/idle"]}
HTML = answer(200, b"<html>")
SHORT = b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n{}"
SHORT_PIECES = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n[1,2\r\n"
BUSY = answer(429, b'{"detail": "too many", "errors": []}', Retry_After="0")
AWAY = answer(503, b'{"detail": "away", "errors": []}', Retry_After="0")
NOTHING_TWICE = {
    *("cancel_job", "retry_job", "verify_job", "verify_leaderboard", "add_task"),
    *("pause_sweep", "resume_sweep", "cancel_sweep", "retry_sweep"),
    *("call_tool", "submit_session", "import_sweep"),
}
"""Methods that change something more when they are sent again."""
GENERAL = {
    "get",
    "get_bytes",
    "get_patiently",
    "health",
    "post",
    "put",
    "upload",
    "download",
    "pages",
    "close",
}
WAITING = {"wait_for_job", "wait_for_verification", "wait_for_sweep"}
GIVEN: dict[str, Any] = {
    "job_id": JOB,
    "sweep_id": SWEEP,
    "other_id": SWEEP,
    "session_id": JOB,
    "verification_id": "check_0a1b2c3d4e5f60718293",
    "spec": SPEC,
    "source": b"{}",
}


def methods() -> list[str]:
    return [
        name
        for name, found in inspect.getmembers(Client, callable)
        if not name.startswith("_") and name not in GENERAL
    ]


def named(name: str) -> list[str]:
    """Arguments of a method that become a part of a path."""
    known = inspect.signature(getattr(Client, name)).parameters
    return [one for one in known if one.endswith("_id") or (one, name) == ("name", "task")]


def arguments(name: str, target, **instead: Any) -> dict[str, Any]:
    """Something for each argument that a method must have."""
    needed = [
        parameter.name
        for parameter in inspect.signature(getattr(Client, name)).parameters.values()
        if parameter.default is parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
    ]
    known = {**GIVEN, "target": target / "x", **instead}
    return {one: known.get(one, "lift-1") for one in needed if one != "self"}


def ask(client, name: str, given: dict[str, Any]) -> Any:
    """What a method answers, the first of it where it answers with many."""
    answered = getattr(client, name)(**given)
    return next(iter(answered)) if inspect.isgenerator(answered) else answered


@pytest.mark.parametrize(
    ("said", "error", "says"),
    [
        (HTML, NotAnApiError, "does not answer in JSON"),
        (answer(200, b"\xff"), NotAnApiError, "does not answer in JSON"),
        (answer(200, b"[" * 100_000), NotAnApiError, "does not answer in JSON"),
        (answer(200, b""), NotAnApiError, "does not answer in JSON"),
        (SHORT, UnreachableError, "no BuildArena answers"),
        (SHORT_PIECES, UnreachableError, "no BuildArena answers"),
        (b"SSH-2.0-OpenSSH\r\n", UnreachableError, "no BuildArena answers"),
        (b"\x1b[2Jx\r\n\r\n", UnreachableError, "no BuildArena answers"),
        (b"", UnreachableError, "no BuildArena answers"),
        (answer(302, Location="http://127.0.0.1:1/"), RefusedError, "HTTP 302"),
        (answer(500, b"<html>"), ServiceFaultError, "HTTP 500"),
        (answer(418, b"[]"), RefusedError, "HTTP 418"),
        (answer(422, b'{"detail": 5, "errors": [7]}'), RefusedError, "HTTP 422"),
        (answer(422, b'{"detail": "no", "errors": null}'), RefusedError, "HTTP 422"),
    ],
)
def test_what_is_no_answer_of_an_api_is_one_sentence(make, said, error, says) -> None:
    with wrong_server(said) as server, pytest.raises(error, match=says) as raised:
        make(server.url).tasks()
    assert isinstance(raised.value, ClientError)
    assert str(raised.value).isprintable()


def test_nobody_there(make) -> None:
    began = time.monotonic()
    with pytest.raises(UnreachableError, match=r"no BuildArena answers at http://127.0.0.1:1 \("):
        make("http://127.0.0.1:1").tasks()
    assert time.monotonic() - began < BREAK_PAUSE_S


def test_a_key_goes_to_one_host_alone(make, monkeypatch) -> None:
    with wrong_server(answer(200, b"[]")) as other:
        for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, other.url)
        for status in (301, 302, 303, 307, 308):
            moved = answer(status, Location=f"{other.url}/v1/tasks")
            with wrong_server(moved) as server:
                client = make(server.url, SECRET)
                for send in (client.tasks, lambda: client.submit_job("a", "b")):  # noqa: B023
                    with pytest.raises(RefusedError, match=f"HTTP {status}"):
                        send()
                assert server.headers("Authorization") == [f"Bearer {SECRET}"] * 2
        assert other.received == []


@pytest.mark.parametrize("status", [400, 401, 403, 404, 409, 413, 422, 429, 500, 503])
def test_a_key_is_in_no_error(make, status) -> None:
    problem = {
        "detail": f"Bearer {SECRET} is bad",
        "errors": [{"field": SECRET, "message": f"not {SECRET}", "choices": [SECRET]}],
    }
    with wrong_server(answer(status, json.dumps(problem).encode())) as server:
        client = make(server.url, SECRET)
        with pytest.raises(ClientError) as raised:
            client.tasks()
    error = raised.value
    told = [str(error), repr(error), str(vars(error)), *traceback.format_exception(error)]
    assert SECRET not in "".join(told)
    assert SECRET not in repr(client.made)
    assert server.url in repr(client.made)


@pytest.mark.parametrize("key", ["a\r\nHost: x", "é", "a\0b"])
def test_what_is_no_key_is_refused_unseen(make, key) -> None:
    with pytest.raises(BadArgumentError, match="is not a key") as refused:
        make("http://127.0.0.1:1", key)
    assert key not in str(refused.value)


@pytest.mark.parametrize(
    "url",
    [
        *("ftp://x", "nonsense", "http://", "http://x:99999", "http://x:0", "http://["),
        *("http://x/?a=b", "http://x/#y", "http://x/\r\n", "file:///etc/passwd", ""),
    ],
)
def test_what_is_no_url_is_refused(make, url) -> None:
    with pytest.raises(BadArgumentError, match="is not the URL of an API"):
        make(url)


def test_a_password_in_a_url_is_refused_unseen(make) -> None:
    with pytest.raises(BadArgumentError, match="no user or password") as refused:
        make("http://me:hush@127.0.0.1:1")
    assert "hush" not in str(refused.value)


@pytest.mark.parametrize("name", methods())
def test_only_what_may_be_carried_out_twice_is_sent_twice(make, name, tmp_path) -> None:
    """After a cut and after 503 nobody knows what was done."""
    once = name in NOTHING_TWICE
    streams = name.endswith("_events") or name in WAITING or name == "watch_sweep"
    patience = Patience(restart_s=0.0)
    for said in (b"", AWAY):
        with wrong_server(said, said, answer(404)) as server:
            client = make(server.url, patience=patience)
            with pytest.raises(ClientError) as raised:
                ask(client, name, arguments(name, tmp_path))
        if once:
            assert len(server.received) == 1, (said, server.lines)
            assert isinstance(raised.value, UnreachableError)
        elif not streams and name not in {"export_sweep", "download_artifact"}:
            assert len(server.received) == 3, (said, server.lines)
            assert len(set(server.headers("Idempotency-Key"))) == 1
            assert len(set(server.received)) == 1


@pytest.mark.parametrize("name", methods())
def test_what_was_refused_as_one_too_many_is_sent_again(make, name, tmp_path) -> None:
    with wrong_server(BUSY, BUSY, answer(404)) as server, pytest.raises(RefusedError) as raised:
        ask(make(server.url), name, arguments(name, tmp_path))
    assert raised.value.status == 404
    assert len(server.received) == 3
    assert len(set(server.received)) == 1


@pytest.mark.parametrize("name", [one for one in methods() if named(one)])
def test_what_is_no_name_is_never_sent(make, name, tmp_path) -> None:
    given = arguments(name, tmp_path)
    bad = ["..", ".", "", "a/b", "../keys", "a\nb", "a\0b", None, 5]
    with wrong_server(answer(200)) as server:
        client = make(server.url)
        for one, word in product(named(name), bad):
            with pytest.raises(BadArgumentError, match="is not a name"):
                ask(client, name, {**given, one: word})
    assert server.received == []


@pytest.mark.parametrize("path", ["/v1/jobs/../keys", "/v1/x#y", "//evil/v1", "http://evil/v1/x"])
def test_no_other_path_is_ever_sent(make, path) -> None:
    with wrong_server(answer(200)) as server:
        client = make(server.url)
        for send in (client.get, client.post, client.get_bytes):
            with pytest.raises(BadArgumentError, match="not a path of the service"):
                send(path)
    assert server.received == []


def test_no_header_and_no_document_is_made_of_nonsense(make) -> None:
    with wrong_server(answer(200)) as server:
        client = make(server.url)
        with pytest.raises(BadArgumentError, match="can't be sent as Idempotency-Key"):
            client.submit_sweep(SPEC, request_key="a\r\nX: y")
        for nonsense in (float("nan"), {1, 2}, object()):
            with pytest.raises(BadArgumentError, match="can't be sent as JSON"):
                client.submit_sweep({**SPEC, "seeds": nonsense})
    assert server.received == []


@pytest.mark.parametrize(
    ("asked", "patience"),
    [
        ("9999", Patience(too_many_s=0.2)),
        ("soon", Patience()),
        ("", Patience()),
        ("-1", Patience()),
    ],
)
def test_patience_ends(make, asked, patience) -> None:
    began = time.monotonic()
    busy = answer(429, b'{"detail": "too many", "errors": []}', Retry_After=asked)
    with wrong_server(busy) as server, pytest.raises(TooManyRequestsError, match="too many"):
        make(server.url, patience=patience).tasks()
    assert len(server.received) == 1
    assert time.monotonic() - began < 2.0


def test_as_much_time_passes_as_the_service_asks_for(make) -> None:
    busy = answer(429, Retry_After="1")
    with wrong_server(busy, answer(200, b"[]")) as server:
        began = time.monotonic()
        assert make(server.url).tasks() == []
        assert time.monotonic() - began >= 1.0


def test_a_bad_state_of_health_is_an_answer(make) -> None:
    with wrong_server(answer(503, b'{"status": "bad"}', Retry_After="0")) as server:
        assert make(server.url).health() == {"status": "bad"}
    assert len(server.received) == 1


def test_a_silent_server_is_given_up_and_asked_once(make) -> None:
    with wrong_server(None) as server:
        client = make(server.url, timeout_s=0.2)
        for send in (client.tasks, lambda: client.call_tool(JOB, "start")):
            with pytest.raises(TimedOutError, match="no BuildArena answers"):
                send()
        assert len(server.received) == 2


def test_a_download_is_there_whole_or_not_at_all(make, tmp_path) -> None:
    target = tmp_path / "x.zip"
    for said, error in (
        (SHORT, UnreachableError),
        (SHORT_PIECES, UnreachableError),
        (AWAY[:20], UnreachableError),
        (answer(404), RefusedError),
        (answer(302), RefusedError),
        (answer(503), UnavailableError),
    ):
        with wrong_server(said) as server, pytest.raises(error):
            make(server.url).export_sweep(SWEEP, target)
        assert list(tmp_path.iterdir()) == []
    with wrong_server(BUSY, answer(200, b"PK01")) as server:
        make(server.url).export_sweep(SWEEP, target)
        with pytest.raises(FileNotFoundError):
            make(server.url).export_sweep(SWEEP, tmp_path / "no" / "x")
    assert target.read_bytes() == b"PK01"


def test_an_older_file_stays_until_the_new_one_is_whole(make, tmp_path) -> None:
    target = tmp_path / "x.zip"
    target.write_bytes(b"old")
    with wrong_server(SHORT) as server, pytest.raises(UnreachableError):
        make(server.url).export_sweep(SWEEP, target)
    assert target.read_bytes() == b"old"


def test_bytes_that_arrive_damaged_are_not_given(make, tmp_path) -> None:
    listed = json.dumps([{"name": "machine", "hash": "0" * 64, "size": 2, "media_type": "x"}])
    said = [answer(200, listed.encode()), answer(200, b"{}")]
    with wrong_server(*said, *said) as server:
        client = make(server.url)
        with pytest.raises(DamagedError, match="arrived damaged"):
            client.artifact(JOB, "machine")
        with pytest.raises(DamagedError, match="arrived damaged"):
            client.download_artifact(JOB, "machine", tmp_path / "m")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_sent_whole_each_time(make, tmp_path) -> None:
    file = tmp_path / "machine.json"
    file.write_bytes(bytes(range(256)) * 8000)
    with wrong_server(BUSY, b"", AWAY, answer(200)) as server:
        assert make(server.url).check_machine(file) == {}
    bodies = [request.partition(b"\r\n\r\n")[2] for request in server.received]
    assert bodies == [file.read_bytes()] * 4
    assert server.headers("Content-Length") == ["2048000"] * 4


def event(number: int, **data: Any) -> bytes:
    told = json.dumps({"job": JOB, "sweep": None, "at": "2026-01-01T00:00:00+00:00", **data})
    return f"id: {number}\r\nevent: turn\r\ndata: {told}\r\n\r\n".encode()


def test_a_stream_that_is_cut_goes_on_where_it_was(make) -> None:
    head = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n"
    pieces = [
        head + b": ping\r\n\r\n" + event(1) + event(2) + event(3)[:30],
        b"",
        AWAY,
        head,
        head + event(3, said="é") + event(4),
        answer(404),
    ]
    seen = []
    with wrong_server(*pieces) as server:
        events = make(server.url).job_events(JOB)
        with pytest.raises(RefusedError, match="HTTP 404"):
            seen.extend(one for one in iter(lambda: next(events), None))
    assert [one["id"] for one in seen] == [1, 2, 3, 4]
    assert seen[2]["data"] == {"said": "é"}
    assert server.headers("Last-Event-ID") == ["0", "2", "2", "2", "2", "4"]


def test_a_stream_of_nonsense_is_refused(make) -> None:
    head = b"HTTP/1.1 200 OK\r\n\r\n"
    for nonsense in (b"id: x\ndata: {}\n\n", b"id: 1\ndata: [\n\n", b"id: 1\ndata: 5\n\n"):
        with wrong_server(head + nonsense) as server, pytest.raises(NotAnApiError):
            next(iter(make(server.url).job_events(JOB)))
