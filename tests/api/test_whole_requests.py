"""Requests are whole and meant: bodies, names, pages, depth, methods, proxies."""

import json
import re
import socket
import time
from urllib.parse import urlsplit

import httpx
import pytest
from pydantic import ValidationError
from support.clients.tenants import operator
from support.contract import contract
from support.servers.live_api import api_client, live_api

from buildarena_pipeline.runtime.context import open_context
from buildarena_pipeline.runtime.settings import Settings

CONTRACT = contract()
METHODS = ("GET", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "PROPFIND")
JOB = json.dumps({"task": "support-1", "model": "builtin/idle"}).encode()
OPEN = json.dumps({"task": "support-1", "agent": "me"}).encode()


@pytest.fixture(scope="module")
def api(database_url, broker_url, tmp_path_factory):
    """One API for all requests that change nothing."""
    data = tmp_path_factory.mktemp("data")
    context = open_context(
        Settings(database_url=database_url, broker_url=broker_url, data=data, lease_s=2.0)
    )
    with api_client(context, raise_server_exceptions=False) as client:
        yield client
    context.close()


@pytest.fixture
def url(context):
    with live_api(context) as found:
        yield found


def send_raw(url: str, data: bytes, *, half_close: bool = False) -> None:
    parts = urlsplit(url)
    with socket.create_connection((parts.hostname, parts.port), timeout=5) as connection:
        connection.sendall(data)
        if half_close:
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(1000):
                pass


def cut_off(path: str, body: bytes, *, chunked: bool) -> bytes:
    head = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n".encode()
    if chunked:
        # The last chunk, which has no bytes, is missing.
        return head + b"Transfer-Encoding: chunked\r\n\r\n%x\r\n%s\r\n" % (len(body), body)
    return head + b"Content-Length: %d\r\n\r\n" % (len(body) + 1) + body


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("half_close", [False, True])
@pytest.mark.parametrize("chunked", [False, True])
def test_a_body_that_was_cut_off_is_never_processed(url, context, chunked, half_close) -> None:
    running = httpx.post(f"{url}/v1/sweeps", json={**sweep_of(9), "name": "kept"}).json()["id"]
    before = len(context.store.jobs.page(limit=100))
    for path, body in (
        ("/v1/jobs", JOB),
        ("/v1/sweeps", json.dumps(sweep_of(2)).encode()),
        (f"/v1/sweeps/{running}/cancel", b"{}"),
        ("/v1/sessions", OPEN),
    ):
        send_raw(url, cut_off(path, body, chunked=chunked), half_close=half_close)
    # The service answers others, and has met all of the above by then.
    time.sleep(0.3)
    assert httpx.get(f"{url}/v1/sweeps/{running}").json()["state"] == "active"
    assert len(context.store.jobs.page(limit=100)) == before
    # The same requests, whole, do something: the test would notice.
    head = {"Content-Type": "application/json"}
    assert httpx.post(f"{url}/v1/jobs", content=JOB, headers=head).status_code == 202


def sweep_of(samples: int) -> dict[str, object]:
    return {"tasks": ["support-1"], "models": ["builtin/idle"], "samples": samples}


@pytest.mark.parametrize(
    "host",
    ["localhost", "LOCALHOST:8321", "127.0.0.1", "127.0.0.1:1", "127.8.9.255", "[::1]", "[::1]:80"],
)
def test_names_of_this_machine_are_served(api, host) -> None:
    for path in ("/v1/health", "/v1/jobs", "/docs", "/openapi.json"):
        assert api.get(path, headers={"Host": host}).status_code == 200
    own = {"Host": host, "Origin": f"http://{host}", "Sec-Fetch-Site": "same-origin"}
    assert api.get("/v1/jobs", headers=own).status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example", "localhost.evil.com", "evil.com:127.0.0.1", "127.0.0.1.nip.io"),
        *("127.0.0.1.", "localhost.", "user@localhost", "localhost@evil.com", "localhost:80:80"),
        *("localhost:", "localhost:port", "localhost evil", "127.0.0.1,evil.com", " ", ""),
        *("127.0.0.256", "127.1", "128.0.0.1", "0.0.0.0", "0x7f000001", "2130706433"),
        *("::1", "[::1", "[::2]", "[::ffff:127.0.0.1]"),
    ],
)
def test_other_names_are_misdirected(api, host) -> None:
    for path in ("/v1/health", "/v1/metrics", "/docs", "/v1/jobs", "/nothing"):
        answer = api.get(path, headers={"Host": host})
        assert answer.status_code == 421, path
        assert answer.headers["content-type"] == "application/problem+json"


def test_no_name_and_two_names_are_misdirected(url) -> None:
    parts = urlsplit(url)
    for hosts in (b"", b"Host: 127.0.0.1\r\nHost: evil.com\r\n"):
        with socket.create_connection((parts.hostname, parts.port), timeout=5) as connection:
            connection.sendall(b"GET /v1/jobs HTTP/1.0\r\n" + hosts + b"\r\n")
            assert connection.recv(100).split()[1] in {b"421", b"400"}


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "null"},
        {"Origin": "http://evil.example"},
        {"Origin": "http://127.0.0.1:3000"},
        {"Origin": "http://localhost"},
        {"Origin": "http://127.0.0.1.evil.com"},
        {"Origin": "file://127.0.0.1"},
        {"Origin": ""},
        {"Sec-Fetch-Site": "cross-site"},
        {"Origin": "http://127.0.0.1", "Sec-Fetch-Site": "cross-site"},
    ],
)
def test_foreign_pages_are_not_served(api, context, headers) -> None:
    for method, path in (("GET", "/v1/jobs"), ("POST", "/v1/jobs"), ("GET", "/v1/health")):
        content = JOB if method == "POST" else None
        answer = api.request(method, path, content=content, headers=headers)
        assert answer.status_code == 403
    assert context.store.jobs.page(limit=1) == []


LINK = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
"""What a browser says of itself when a link on another site is followed."""


@pytest.mark.parametrize("path", ["/", "/sweeps/sweep_1", "/jobs/job_1?view=trial", "/models/a/b"])
def test_a_link_on_another_site_opens_a_page(api, path) -> None:
    answer = api.get(path, headers=LINK)
    assert answer.status_code == 200
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
    assert "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize(
    ("method", "path", "change"),
    [
        *(("GET", path, {}) for path in ("/v1/jobs", "/v1/health", "/docs", "/openapi.json")),
        *(("GET", path, {}) for path in ("/jobs/%0A", "//v1/jobs", "/assets/index.js")),
        ("POST", "/jobs", {}),
        ("POST", "/", {}),
        ("HEAD", "/jobs", {}),
        ("GET", "/jobs", {"Sec-Fetch-Dest": "iframe"}),
        ("GET", "/jobs", {"Sec-Fetch-Dest": "script"}),
        ("GET", "/jobs", {"Sec-Fetch-Mode": "no-cors"}),
        ("GET", "/jobs", {"Sec-Fetch-Mode": "cors"}),
        ("GET", "/jobs", {"Sec-Fetch-Mode": ""}),
        ("GET", "/jobs", {"Origin": "http://evil.example"}),
        ("GET", "/jobs", {"Origin": "null"}),
    ],
)
def test_nothing_else_comes_from_another_site(api, method, path, change) -> None:
    answer = api.request(method, f"{api.base_url}{path}", headers=LINK | change)
    assert answer.status_code == 403, answer.text[:200]


def test_a_link_under_a_foreign_name_is_misdirected(api) -> None:
    assert api.get("/jobs", headers=LINK | {"Host": "evil.example"}).status_code == 421


def test_with_keys_names_do_not_matter(guarded) -> None:
    headers = {"Host": "arena.example", "Origin": "null"}
    assert operator(guarded).ask("GET", "/v1/jobs", headers=headers).status_code == 200


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/sweeps", "/v1/sessions", "/v1/keys"])
@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ('{"a":', "}")])
@pytest.mark.parametrize("depth", [65, 900, 100_000])
def test_deep_bodies_are_refused(api, path, opening, closing, depth) -> None:
    for body in (opening * depth, opening * depth + "1" + closing * depth):
        answer = api.post(path, content=body, headers={"Content-Type": "application/json"})
        assert answer.status_code == 422
        assert "64 arrays or objects" in answer.json()["detail"]


def test_a_number_of_many_digits_is_refused(api) -> None:
    body = b'{"task": "support-1", "model": "builtin/idle", "seed": ' + b"9" * 5000 + b"}"
    answer = api.post("/v1/jobs", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422


@pytest.mark.parametrize("template", sorted(CONTRACT["paths"]))
def test_a_method_that_a_path_does_not_have_is_405(api, template) -> None:
    known = {method.upper() for method in CONTRACT["paths"][template]}
    path = template
    for name in ("job_id", "sweep_id", "key_id", "session_id", "verification_id", "name"):
        path = path.replace("{" + name + "}", "x")
    path = path.replace("{artifact}", "machine")
    for method in sorted(set(METHODS) - known):
        answer = api.request(method, path)
        assert answer.status_code == 405, (method, path)
        assert set(answer.headers["allow"].split(", ")) == known


def test_405_needs_no_key(guarded) -> None:
    assert guarded.get("/v1/jobs/job_x/cancel").status_code == 405
    assert guarded.delete("/v1/jobs").status_code == 405
    assert guarded.get("/v1/nothing").status_code == 404


@pytest.mark.parametrize("ending", ["%0A", "%0D%0A", "%00"])
def test_paths_are_matched_whole(api, ending) -> None:
    for path in ("/v1/jobs", "/v1/tasks/support-1", "/v1/health"):
        assert api.get(path).status_code == 200
        assert api.get(path + ending).status_code == 404


@pytest.mark.parametrize(
    ("path", "body", "field"),
    [
        ("/v1/sessions", {"task": "support-1", "agent": "me\n"}, "agent"),
        ("/v1/sessions", {"task": "support-1\n", "agent": "me"}, "task"),
        ("/v1/sweeps", {"tasks": ["support-1"], "models": ["builtin/idle"], "name": "x\n"}, "name"),
        ("/v1/jobs", {"task": "support-1\n", "model": "builtin/idle"}, "task"),
        ("/v1/keys", {"name": "ada\n", "scopes": ["read"]}, "name"),
    ],
)
def test_names_are_matched_whole(api, path, body, field) -> None:
    answer = api.post(path, json=body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


@pytest.mark.parametrize("path", ["/v1/jobs?id_prefix=job_0%0A", "/v1/tasks/lift-1?version=0%0A"])
def test_parameters_are_matched_whole(api, path) -> None:
    assert api.get(path).status_code == 422


UNKNOWN = "0a1b2c3d4e5f60718293"


@pytest.mark.parametrize(
    "name", ["x", "UPPER", "a_b", "job_" + UNKNOWN, "x" * 300, "%20", "%C3%BC", "%22", "..%2F"]
)
@pytest.mark.parametrize("template", sorted(t for t in CONTRACT["paths"] if "{" in t))
def test_what_nobody_has_in_a_path_is_404(api, template, name) -> None:
    bodies = {"budget": {}, "calls": {"tool": "start"}, "rotate": {}}
    for method in CONTRACT["paths"][template]:
        path = re.sub(r"\{[a-z_]+\}", name, template)
        answer = api.request(method.upper(), path, json=bodies.get(path.rpartition("/")[2]))
        assert answer.status_code in {404, 405}, (method, path, answer.text)
        assert answer.status_code == 404 or "%2F" in name


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("GET", "/v1/jobs?task=x", None),
        ("GET", "/v1/jobs?model=x", None),
        ("GET", "/v1/leaderboard?track=x", None),
        ("GET", "/v1/leaderboard?task=x", None),
        ("GET", "/v1/leaderboard/export?level=99", None),
        ("POST", "/v1/leaderboard/verify", {"model": "x"}),
        ("POST", "/v1/jobs", {"task": "x", "model": "builtin/idle"}),
        ("POST", "/v1/sweeps", {"tasks": ["support-1"], "models": ["x"]}),
        ("POST", "/v1/sweeps/estimate", {"tasks": ["x"], "models": ["builtin/idle"]}),
        ("POST", "/v1/sessions", {"task": "x", "agent": "me"}),
    ],
)
def test_unknown_names_in_a_query_or_a_body_are_422(api, method, path, body) -> None:
    answer = api.request(method, path, json=body)
    assert answer.status_code == 422
    assert "x" in answer.json()["errors"][0]["message"] or "99" in answer.text


@pytest.mark.parametrize("given", ["*", "proxy.example", "10.0.0.0/8,*", "127.0.0.1:80"])
def test_proxies_are_named_by_address(given) -> None:
    with pytest.raises(ValidationError, match="neither an address nor a network"):
        Settings(trusted_proxies=given)


def test_proxies_are_none_by_default() -> None:
    assert Settings().trusted_proxies == ""
    assert Settings(trusted_proxies="10.0.0.0/8, ::1").trusted_proxies == "10.0.0.0/8,::1"
