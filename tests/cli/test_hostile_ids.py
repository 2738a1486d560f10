"""No id that a person, a model or a server gives leads a request to another route."""

import asyncio
import json
import threading
from collections.abc import Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import ClassVar

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcp.types import CallToolRequestParams

from buildarena_cli.client import Client, at
from buildarena_cli.errors import CommandError
from buildarena_cli.ids import checked_id, whole_id
from buildarena_cli.mcp_server import _act, _manage, make_server

JOB = "job_0a1b2c3d4e5f60718293"
CANCELS = "../sweeps/sweep_0a1b2c3d4e5f60718293/cancel#"
WORDS = ("sweeps", "cancel", JOB, "job_", "HTTP/1.1", "é", "\u2215", "\uff0f")
HOSTILE = st.one_of(
    st.text(max_size=40),
    st.lists(
        st.sampled_from(
            ["..", ".", "/", "\\", "%2f", "%2e%2e", "#", "?", "&", ";", "\n", "\0", " ", *WORDS]
        ),
        max_size=8,
    ).map("".join),
)


class _Recorder(BaseHTTPRequestHandler):
    paths: ClassVar[list[str]] = []

    def _answer(self) -> None:
        self.paths.append(self.path)
        self.rfile.read(int(self.headers.get("Content-Length") or 0))
        body = json.dumps({"ok": True, "feedback": "", "jobs": [], "sweeps": []}).encode()
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    do_GET = do_POST = do_PUT = _answer  # noqa: N815 - names of the library

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def client() -> Iterator[Client]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Recorder)
    _Recorder.paths.clear()
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield Client(f"http://127.0.0.1:{server.server_port}", "operator")
    server.shutdown()
    thread.join()
    server.server_close()


usual = settings(
    max_examples=60,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def is_safe(path: str, parts: int) -> bool:
    """Whether a server that decodes and normalises what it likes finds the same route."""
    plain = path.partition("?")[0]
    segments = plain.split("/")
    return (
        len(segments) == parts
        and "#" not in path
        and not any(segment in {"", ".", ".."} for segment in segments[1:])
        and path.isprintable()
        and path.isascii()
    )


@usual
@given(part=HOSTILE)
def test_any_part_stays_one_part(client, part) -> None:
    _Recorder.paths.clear()
    try:
        client.get(at("jobs", part))
    except CommandError:
        assert _Recorder.paths == []
        return
    (path,) = _Recorder.paths
    assert is_safe(path, 4), path


@usual
@given(session=HOSTILE.filter(lambda text: text != JOB))
def test_a_session_is_an_id_or_nothing_is_sent(client, session) -> None:
    _Recorder.paths.clear()
    for send in (
        lambda: _act(client, "start", {"session": session}),
        lambda: _manage(client, "submit", {"session": session}),
        lambda: _manage(client, "get_result", {"session": session}),
    ):
        with pytest.raises(CommandError, match="is not the id of a job"):
            send()
    assert _Recorder.paths == []


@usual
@given(word=HOSTILE)
@pytest.mark.parametrize("kind", ["job", "sweep", "key"])
def test_a_word_of_the_command_line_is_an_id_or_nothing_is_sent(client, kind, word) -> None:
    _Recorder.paths.clear()
    with suppress(CommandError, TypeError):
        found = whole_id(client, kind, word)
        assert checked_id(kind, found) == found
    assert all(is_safe(path, 3) for path in _Recorder.paths)


def test_ids_are_matched_whole(subtests) -> None:
    for given_id in [None, 5, ["x"], {}, JOB + "\n", JOB.upper(), "job_", CANCELS]:
        with subtests.test(given_id=given_id):
            with pytest.raises(CommandError, match="is not the id of a job"):
                checked_id("job", given_id)
            assert checked_id("job", JOB) == JOB


@pytest.mark.parametrize(
    "path",
    ["/v1/jobs/../keys", "/v1/jobs/x#y", "/v1/./jobs", "/v1/jobs/a b", "//evil/v1", "/v1/jobs/é"],
)
def test_no_other_path_is_ever_sent(client, path) -> None:
    with pytest.raises(CommandError, match="not a path of the service"):
        client.get(path)
    assert _Recorder.paths == []


def test_a_model_can_not_cancel_a_sweep(client) -> None:
    handler = make_server(client).get_request_handler("tools/call")
    call = CallToolRequestParams(name="start", arguments={"session": CANCELS})
    answer = asyncio.run(handler.handler(None, call))
    assert answer.is_error
    assert _Recorder.paths == []
