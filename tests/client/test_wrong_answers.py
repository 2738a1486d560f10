"""Servers that refuse, break off, or are none of ours, what both make of it, and their keys."""

import contextlib
import inspect
import json
import socket
import ssl
import subprocess
import threading
import time
import traceback
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
from buildarena_client.transport import BREAK_PAUSE_S, LONGEST_PAUSE_S

SECRET = "ba_secret-that-nobody-sees"
JOB = "job_0a1b2c3d4e5f60718293"
SWEEP = "sweep_0a1b2c3d4e5f60718293"
SPEC = {"tasks": ["lift-1"], "models": ["builtin/idle"]}
HTML = answer(200, b"<html>")
SHORT = b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n{}"
SHORT_PIECES = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n[1,2\r\n"
EMPTY = b'{"data": [], "next_cursor": null}'
BUSY = answer(429, b'{"detail": "too many", "errors": []}', Retry_After="0")
STREAM = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n"
AWAY = answer(503, b'{"detail": "away", "errors": []}', Retry_After="0")
NOTHING_TWICE = {
    *("cancel_job", "retry_job", "verify_job", "verify_leaderboard", "add_task"),
    *("pause_sweep", "resume_sweep", "cancel_sweep", "retry_sweep", "set_sweep_budget"),
    *("call_tool", "test_session", "submit_session"),
}
"""Methods that change something more when they are sent again."""
GENERAL = {"get", "get_bytes", "get_patiently", "every", "health", "post", "put"}
GENERAL |= {"upload", "download", "pages", "close"}
WAITING = {"wait_for_job", "wait_for_verification", "wait_for_sweep"}
GIVEN: dict[str, Any] = dict.fromkeys(("job_id", "session_id"), JOB)
GIVEN |= {**dict.fromkeys(("sweep_id", "other_id"), SWEEP), "spec": SPEC, "source": b"{}"}
GIVEN["verification_id"] = "check_0a1b2c3d4e5f60718293"


PUBLIC = {name for name, _ in inspect.getmembers(Client, callable) if name[0] != "_"}
METHODS = sorted(PUBLIC - GENERAL)


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


def test_what_is_no_answer_of_an_api_is_one_sentence(make) -> None:
    for said, error, says in (
        *((page, NotAnApiError, "does not answer in JSON") for page in (HTML, answer(200, b""))),
        *((answer(200, n), NotAnApiError, "answer in JSON") for n in (b"\xff", b"[" * 100_000)),
        *((cut, UnreachableError, "no BuildArena answers") for cut in (SHORT, SHORT_PIECES, b"")),
        (b"SSH-2.0-OpenSSH\r\n", UnreachableError, "no BuildArena answers"),
        (b"\x1b[2Jx\r\n\r\n", UnreachableError, "no BuildArena answers"),
        (answer(302, Location="http://127.0.0.1:1/"), RefusedError, "HTTP 302"),
        (answer(500, b"<html>"), ServiceFaultError, "HTTP 500"),
        (answer(418, b"[]"), RefusedError, "HTTP 418"),
        (answer(499), RefusedError, "HTTP 499"),
        (answer(520), ServiceFaultError, "HTTP 520"),
        (answer(422, b'{"detail": 5, "errors": [7]}'), RefusedError, "HTTP 422"),
        (answer(422, b'{"detail": "no", "errors": null}'), RefusedError, "HTTP 422"),
    ):
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


@pytest.mark.usefixtures("pauses")
def test_only_what_may_be_carried_out_twice_is_sent_twice(make, tmp_path) -> None:
    """After a cut and after 503 nobody knows what was done."""
    for name, said in product(METHODS, (b"", AWAY)):
        streams = name.endswith("_events") or name in WAITING or name == "watch_sweep"
        with wrong_server(said, said, answer(404)) as server:
            client = make(server.url, retries=RetryPolicy(restart_s=0.0))
            with pytest.raises(ClientError) as raised:
                ask(client, name, arguments(name, tmp_path))
        if name in NOTHING_TWICE:
            assert len(server.received) == 1, (name, said, server.lines)
            assert isinstance(raised.value, UnreachableError)
        elif not streams and name != "download_artifact":
            assert len(server.received) == 3, (name, said, server.lines)
            assert len(set(server.headers("Idempotency-Key"))) == 1
            assert len(set(server.received)) == 1


def test_what_was_refused_as_one_too_many_is_sent_again(make, tmp_path) -> None:
    for name in METHODS:
        with wrong_server(BUSY, BUSY, answer(404)) as server, pytest.raises(RefusedError) as raised:
            ask(make(server.url), name, arguments(name, tmp_path))
        assert raised.value.status == 404
        assert len(server.received) == 3, name
        assert len(set(server.received)) == 1


def test_what_is_no_name_or_path_is_never_sent(make, tmp_path) -> None:
    bad = ["..", ".", "", "a/b", "../keys", "a\nb", "a\0b", None, 5]
    with wrong_server(answer(200)) as server:
        client = make(server.url)
        for name in METHODS:
            # Arguments that become a part of a path.
            known = inspect.signature(getattr(Client, name)).parameters
            named = [n for n in known if n.endswith("_id") or (n, name) == ("name", "task")]
            for one, word in product(named, bad):
                with pytest.raises(BadArgumentError, match="is not a name"):
                    ask(client, name, {**arguments(name, tmp_path), one: word})
        for path in ("/v1/jobs/../keys", "/v1/x#y", "//evil/v1", "http://evil/v1/x"):
            for send in (client.get, client.post, client.get_bytes):
                with pytest.raises(BadArgumentError, match="not a path of the service"):
                    send(path)
        with pytest.raises(BadArgumentError, match="can't be sent as Idempotency-Key"):
            client.submit_sweep(SPEC, request_key="a\r\nX: y")
        for nonsense in (float("nan"), {1, 2}, object()):
            with pytest.raises(BadArgumentError, match="can't be sent as JSON"):
                client.submit_sweep({**SPEC, "seeds": nonsense})
    assert server.received == []


def test_as_much_time_passes_as_the_service_asks_for_and_retries_end(make, pauses) -> None:
    for asked, seconds in (("1", 1.0), ("7", 7.0), ("30", LONGEST_PAUSE_S)):
        pauses.clear()
        with wrong_server(answer(429, Retry_After=asked), answer(200, EMPTY)) as server:
            assert make(server.url).tasks() == []
        assert pauses == [seconds]
    pauses.clear()
    given = dict.fromkeys(("soon", "", "-1"), RetryPolicy())
    given["9999"] = RetryPolicy(too_many_s=0.2)
    for asked, retries in given.items():
        busy = answer(429, b'{"detail": "too many", "errors": []}', Retry_After=asked)
        with wrong_server(busy) as server, pytest.raises(TooManyRequestsError, match="too many"):
            make(server.url, retries=retries).tasks()
        assert len(server.received) == 1
    assert pauses == []


def test_pauses_take_their_time(make) -> None:
    with wrong_server(b"", answer(200, EMPTY)) as server:
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


def test_a_download_is_there_whole_or_not_at_all(make, tmp_path) -> None:
    fresh, target = tmp_path / "fresh.zip", tmp_path / "x.zip"
    target.write_bytes(b"old")
    for said, error in (
        (SHORT, UnreachableError),
        (SHORT_PIECES, UnreachableError),
        (AWAY[:20], UnreachableError),
        (answer(404), RefusedError),
        (answer(302), RefusedError),
        (answer(503), UnavailableError),
    ):
        with wrong_server(said) as server:
            for file in (target, fresh):
                with pytest.raises(error):
                    make(server.url).download("/v1/x", file)
        assert [(file, file.read_bytes()) for file in tmp_path.iterdir()] == [(target, b"old")]
    with wrong_server(BUSY, answer(200, b"PK01")) as server:
        make(server.url).download("/v1/x", target)
        with pytest.raises(FileNotFoundError):
            make(server.url).download("/v1/x", tmp_path / "no" / "x")
    assert target.read_bytes() == b"PK01"


def test_bytes_that_arrive_damaged_are_not_given(make, tmp_path) -> None:
    file = {"name": "machine", "sha256": "0" * 64, "size": 2, "media_type": "x"}
    listed = json.dumps({"data": [file], "next_cursor": None})
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
    told = json.dumps({"job_id": JOB, "sweep_id": None, "at": "2026-01-01T00:00:00+00:00", **data})
    return f"id: {number}\r\nevent: turn\r\ndata: {told}\r\n\r\n".encode()


def test_events_are_the_same_wherever_the_stream_is_cut(make) -> None:
    texts = ["a", "é\u2028", "b"]
    stream = b": ping\r\n\r\n".join(event(n, said=text) for n, text in enumerate(texts, 1))
    head = STREAM.replace(b"\r\n\r\n", b"\r\nTransfer-Encoding: chunked\r\n\r\n")
    for size in (1, 2, 3, 7, 1000):
        pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
        chunks = b"".join(b"%x\r\n%b\r\n" % (len(piece), piece) for piece in pieces)
        with wrong_server(head + chunks + b"0\r\n\r\n") as server:
            seen = list(islice(make(server.url).job_events(JOB), 3))
        assert [(each["id"], each["data"]["said"]) for each in seen] == list(enumerate(texts, 1))
        told = {(each["kind"], each["job_id"], each["sweep_id"]) for each in seen}
        assert told == {("turn", JOB, None)}


@pytest.mark.usefixtures("pauses")
def test_a_stream_that_is_cut_goes_on_where_it_was(make) -> None:
    first = STREAM + b": ping\r\n\r\n" + event(1) + event(2) + event(3)[:30]
    last = STREAM + event(3, said="é") + event(4)
    pieces = [first, b"", AWAY, STREAM, last, answer(404)]
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


def test_pages_and_streams_of_nonsense_are_refused(make) -> None:
    for page in (b"[]", b"{}", b'{"next_cursor": 5}', b"null"):
        with wrong_server(answer(200, page)) as server, pytest.raises(NotAnApiError):
            next(iter(make(server.url).jobs()))
    endless = b"data: " + b"x" * MAX_EVENT_BYTES
    bodies = (b"id: x\ndata: {}\n\n", b"id: 1\ndata: [\n\n", b"id: 1\ndata: 5\n\n", endless)
    for nonsense in (*(STREAM + body for body in bodies), HTML):
        refused = pytest.raises(NotAnApiError, match="the stream holds no events")
        with wrong_server(nonsense) as server, refused:
            next(iter(make(server.url).job_events(JOB)))


def test_a_key_goes_to_one_host_alone(make, monkeypatch) -> None:
    with wrong_server(answer(200, b"[]")) as other:
        for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, other.url)
        for status in (301, 302, 303, 307, 308):
            moved = answer(status, Location=f"{other.url}/v1/tasks")
            with wrong_server(moved) as server:
                client = make(server.url, SECRET)
                for send in (client.tasks, lambda: client.submit_job("a", "b")):
                    with pytest.raises(RefusedError, match=f"HTTP {status}"):
                        send()
                assert server.headers("Authorization") == [f"Bearer {SECRET}"] * 2
        assert other.received == []


def test_a_key_is_in_no_error(make) -> None:
    issue = {"field": SECRET, "message": f"not {SECRET}", "choices": [SECRET]}
    problem = {"detail": f"Bearer {SECRET} is bad", "errors": [issue]}
    for status in (401, 422, 429, 503):
        with wrong_server(answer(status, json.dumps(problem).encode())) as server:
            client = make(server.url, SECRET)
            with pytest.raises(ClientError) as raised:
                client.tasks()
        error = raised.value
        told = [str(error), repr(error), str(vars(error)), *traceback.format_exception(error)]
        assert SECRET not in "".join(told)
        assert SECRET not in repr(client.made)
        assert server.url in repr(client.made)


def test_what_is_no_key_or_url_is_refused_unseen(make) -> None:
    for key in ("a\r\nHost: x", "é", "a\0b"):
        with pytest.raises(BadArgumentError, match="is not a key") as refused:
            make("http://127.0.0.1:1", key)
        assert key not in str(refused.value)
    for url in (
        *("ftp://x", "nonsense", "http://", "http://x:99999", "http://x:0", "http://["),
        *("http://a..b", "http://\u2603.b", "http://" + "a" * 64),
        *("http://x/?a=b", "http://x/#y", "http://x/\r\n", "file:///etc/passwd", ""),
    ):
        with pytest.raises(BadArgumentError, match="is not the URL of an API"):
            make(url)
    for rest in ("127.0.0.1:1", "x:99999", "[", "?"):
        with pytest.raises(BadArgumentError, match="no user or password") as refused:
            make(f"http://me:hush@{rest}")
        assert "hush" not in str(refused.value)


@pytest.mark.parametrize("scheme", ["https", "HTTPS"])
def test_a_server_that_nobody_vouches_for_gets_no_key(make, scheme, tmp_path) -> None:
    file = tmp_path / "server.pem"
    made = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -noenc -subj /CN=x"
    san = ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", "-"]
    done = subprocess.run([*made.split(), *san], check=True, capture_output=True)
    file.write_bytes(done.stdout)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(file)
    received = []

    def serve() -> None:
        connection, _ = listening.accept()
        with contextlib.suppress(OSError), connection:
            with context.wrap_socket(connection, server_side=True) as secured:
                received.append(secured.recv(65536))

    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=serve)
        thread.start()
        url = f"{scheme}://127.0.0.1:{listening.getsockname()[1]}"
        with pytest.raises(UnreachableError, match=r"(?i)certificate.verify"):
            make(url, SECRET).tasks()
        thread.join()
    assert received in ([], [b""])
