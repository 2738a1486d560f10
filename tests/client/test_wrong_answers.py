"""Servers that refuse, are busy, break off, or are none of ours: what both clients make of it."""

import inspect
import json
import time
from itertools import islice, product
from typing import Any

import pytest
from support.servers.wrong_server import answer, wrong_server

from buildarena_client import (
    BadArgumentError,
    Client,
    ClientError,
    DamagedError,
    NotAnApiError,
    RefusedError,
    RetryPolicy,
    ServiceFaultError,
    TimedOutError,
    TooManyRequestsError,
    UnavailableError,
    UnreachableError,
)
from buildarena_client.event_streams import MAX_EVENT_BYTES
from buildarena_client.retries import BREAK_PAUSE_S, LONGEST_PAUSE_S

JOB = "job_0a1b2c3d4e5f60718293"
SWEEP = "sweep_0a1b2c3d4e5f60718293"
SPEC = {"tasks": ["lift-1"], "models": ["builtin/idle"]}
HTML = answer(200, b"<html>")
SHORT = b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n{}"
SHORT_PIECES = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n[1,2\r\n"
BUSY = answer(429, b'{"detail": "too many", "errors": []}', Retry_After="0")
STREAM = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n"
AWAY = answer(503, b'{"detail": "away", "errors": []}', Retry_After="0")
NOTHING_TWICE = {
    *("cancel_job", "retry_job", "verify_job", "verify_leaderboard", "add_task"),
    *("pause_sweep", "resume_sweep", "cancel_sweep", "retry_sweep", "set_sweep_budget"),
    *("call_tool", "test_session", "submit_session"),
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


def test_nobody_there(make, pauses) -> None:
    """A refused connection is tried once: a thousand tries would take minutes."""
    client = make("http://127.0.0.1:1", retries=RetryPolicy(breaks=1000))
    with pytest.raises(UnreachableError, match=r"no BuildArena answers at http://127.0.0.1:1 \("):
        client.tasks()
    assert pauses == []


@pytest.mark.parametrize("name", methods())
@pytest.mark.usefixtures("pauses")
def test_only_what_may_be_carried_out_twice_is_sent_twice(make, name, tmp_path) -> None:
    """After a cut and after 503 nobody knows what was done."""
    once = name in NOTHING_TWICE
    streams = name.endswith("_events") or name in WAITING or name == "watch_sweep"
    retries = RetryPolicy(restart_s=0.0)
    for said in (b"", AWAY):
        with wrong_server(said, said, answer(404)) as server:
            client = make(server.url, retries=retries)
            with pytest.raises(ClientError) as raised:
                ask(client, name, arguments(name, tmp_path))
        if once:
            assert len(server.received) == 1, (said, server.lines)
            assert isinstance(raised.value, UnreachableError)
        elif not streams and name != "download_artifact":
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


@pytest.mark.parametrize(
    ("asked", "retries"),
    [
        ("9999", RetryPolicy(too_many_s=0.2)),
        ("soon", RetryPolicy()),
        ("", RetryPolicy()),
        ("-1", RetryPolicy()),
    ],
)
def test_retries_end(make, pauses, asked, retries) -> None:
    busy = answer(429, b'{"detail": "too many", "errors": []}', Retry_After=asked)
    with wrong_server(busy) as server, pytest.raises(TooManyRequestsError, match="too many"):
        make(server.url, retries=retries).tasks()
    assert len(server.received) == 1
    assert pauses == []


@pytest.mark.parametrize(("asked", "seconds"), [("1", 1.0), ("7", 7.0), ("30", LONGEST_PAUSE_S)])
def test_as_much_time_passes_as_the_service_asks_for(make, pauses, asked, seconds) -> None:
    busy = answer(429, Retry_After=asked)
    with wrong_server(busy, answer(200, b"[]")) as server:
        assert make(server.url).tasks() == []
    assert pauses == [seconds]


def test_pauses_take_their_time(make) -> None:
    with wrong_server(b"", answer(200, b"[]")) as server:
        began = time.monotonic()
        assert make(server.url).tasks() == []
    assert time.monotonic() - began >= BREAK_PAUSE_S


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


@pytest.mark.parametrize("older", [None, b"old"])
def test_a_download_is_there_whole_or_not_at_all(make, tmp_path, older) -> None:
    target = tmp_path / "x.zip"
    if older:
        target.write_bytes(older)
    before = list(tmp_path.iterdir())
    for said, error in (
        (SHORT, UnreachableError),
        (SHORT_PIECES, UnreachableError),
        (AWAY[:20], UnreachableError),
        (answer(404), RefusedError),
        (answer(302), RefusedError),
        (answer(503), UnavailableError),
    ):
        with wrong_server(said) as server, pytest.raises(error):
            make(server.url).download("/v1/x", target)
        assert list(tmp_path.iterdir()) == before
        assert older is None or target.read_bytes() == older
    with wrong_server(BUSY, answer(200, b"PK01")) as server:
        make(server.url).download("/v1/x", target)
        with pytest.raises(FileNotFoundError):
            make(server.url).download("/v1/x", tmp_path / "no" / "x")
    assert target.read_bytes() == b"PK01"


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


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_events_are_the_same_wherever_the_stream_is_cut(make, size) -> None:
    texts = ["a", "é\u2028", "b"]
    stream = b": ping\r\n\r\n".join(event(n, said=text) for n, text in enumerate(texts, 1))
    pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
    chunks = b"".join(b"%x\r\n%b\r\n" % (len(piece), piece) for piece in pieces)
    head = STREAM.replace(b"\r\n\r\n", b"\r\nTransfer-Encoding: chunked\r\n\r\n")
    with wrong_server(head + chunks + b"0\r\n\r\n") as server:
        seen = list(islice(make(server.url).job_events(JOB), 3))
    assert [(each["id"], each["data"]["said"]) for each in seen] == list(enumerate(texts, 1))
    assert {(each["kind"], each["job"], each["sweep"]) for each in seen} == {("turn", JOB, None)}


@pytest.mark.usefixtures("pauses")
def test_a_stream_that_is_cut_goes_on_where_it_was(make) -> None:
    pieces = [
        STREAM + b": ping\r\n\r\n" + event(1) + event(2) + event(3)[:30],
        b"",
        AWAY,
        STREAM,
        STREAM + event(3, said="é") + event(4),
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


def test_streams_that_end_at_once_are_given_up(make) -> None:
    with wrong_server(STREAM + event(1), STREAM) as server:
        events = make(server.url, retries=RetryPolicy(restart_s=0.3)).sweep_events(SWEEP)
        assert next(events)["id"] == 1
        with pytest.raises(UnreachableError, match="ends its streams at once"):
            next(events)
        assert 2 <= len(server.received) <= 4


@pytest.mark.parametrize("page", [b"[]", b"{}", b'{"next_cursor": 5}', b"null"])
def test_what_is_no_page_is_refused(make, page) -> None:
    with wrong_server(answer(200, page)) as server, pytest.raises(NotAnApiError):
        next(iter(make(server.url).jobs()))


def test_a_stream_of_nonsense_is_refused(make) -> None:
    endless = b"data: " + b"x" * MAX_EVENT_BYTES
    bodies = (b"id: x\ndata: {}\n\n", b"id: 1\ndata: [\n\n", b"id: 1\ndata: 5\n\n", endless)
    for nonsense in (*(STREAM + body for body in bodies), HTML):
        with (
            wrong_server(nonsense) as server,
            pytest.raises(NotAnApiError, match="the stream holds no events"),
        ):
            next(iter(make(server.url).job_events(JOB)))
