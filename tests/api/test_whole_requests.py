"""Requests are whole and meant: bodies, names, origins, depth and methods."""

import json
import re
import socket
import time
from urllib.parse import urlsplit

import httpx
import pytest
from support.clients.tenants import operator
from support.contract import contract
from support.servers.live_api import api_client, live_api

from buildarena_backend.process.context import open_context
from buildarena_backend.settings import Settings

CONTRACT = contract()
METHODS = {"GET", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "PROPFIND"}
JSON = {"Content-Type": "application/json"}
PROBLEM = "application/problem+json"
JOB = json.dumps({"task": "support-1", "model": "builtin/idle"}).encode()
SWEEP = {"tasks": ["support-1"], "models": ["builtin/idle"], "samples": 2}
LINK = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
"""What a browser says of itself when a link on another site is followed."""


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


def test_a_body_that_was_cut_off_is_never_processed(context) -> None:
    with live_api(context) as url:
        running = httpx.post(f"{url}/v1/sweeps", json={**SWEEP, "name": "kept"}).json()["id"]
        before = len(context.store.jobs.page(limit=100))
        for path, body in (
            ("/v1/jobs", JOB.replace(b"}", b', "seed": 9}')),
            ("/v1/sweeps", json.dumps({**SWEEP, "samples": 9}).encode()),
            (f"/v1/sweeps/{running}/cancel", b"{}"),
            ("/v1/sessions", b'{"task": "support-1", "agent": "me"}'),
        ):
            for chunked, half_close in ((True, False), (False, True), (True, True)):
                send_raw(url, cut_off(path, body, chunked=chunked), half_close=half_close)
        # The service answers others, and has met all of the above by then.
        time.sleep(0.3)
        assert httpx.get(f"{url}/v1/sweeps/{running}").json()["state"] == "active"
        assert len(context.store.jobs.page(limit=100)) == before
        # The same request, whole, does something: the test would notice.
        assert httpx.post(f"{url}/v1/jobs", content=JOB, headers=JSON).status_code == 200
        parts = urlsplit(url)
        for hosts in (b"", b"Host: 127.0.0.1\r\nHost: evil.com\r\n"):
            with socket.create_connection((parts.hostname, parts.port), timeout=5) as connection:
                connection.sendall(b"GET /v1/jobs HTTP/1.0\r\n" + hosts + b"\r\n")
                assert connection.recv(100).split()[1] in {b"421", b"400"}


def test_only_names_of_this_machine_are_served_without_keys(api, guarded) -> None:
    ours = ["localhost", "LOCALHOST:8321", "127.0.0.1:1", "127.8.9.255", "[::1]", "[::1]:80"]
    others = [
        *("evil.example", "localhost.evil.com", "evil.com:127.0.0.1", "127.0.0.1.nip.io"),
        *("127.0.0.1.", "localhost.", "user@localhost", "localhost@evil.com", "localhost:80:80"),
        *("localhost:", "localhost:port", "localhost evil", "127.0.0.1,evil.com", " ", ""),
        *("127.0.0.256", "127.1", "128.0.0.1", "0.0.0.0", "0x7f000001", "2130706433"),
        *("::1", "[::1", "[::2]", "[::ffff:127.0.0.1]"),
    ]
    served = {host: api.get("/v1/jobs", headers={"Host": host}).status_code for host in ours}
    assert set(served.values()) == {200}, served
    own = {"Host": "[::1]:80", "Origin": "http://[::1]:80", "Sec-Fetch-Site": "same-origin"}
    assert api.get("/v1/jobs", headers=own).status_code == 200
    refused = {host: api.get("/v1/jobs", headers={"Host": host}).status_code for host in others}
    assert set(refused.values()) == {421}, refused
    for path in ("/v1/health", "/v1/metrics", "/docs", "/nothing", "/jobs"):
        answer = api.get(path, headers=LINK | {"Host": "evil.example"})
        assert (answer.status_code, answer.headers["content-type"]) == (421, PROBLEM), path
    foreign = {"Host": "arena.example", "Origin": "null"}
    assert operator(guarded).ask("GET", "/v1/jobs", headers=foreign).status_code == 200


def test_foreign_pages_are_not_served(api) -> None:
    origins = ["null", "http://evil.example", "http://127.0.0.1:3000", "http://localhost", ""]
    origins += ["http://127.0.0.1.evil.com", "file://127.0.0.1"]
    cross = {"Sec-Fetch-Site": "cross-site"}
    asked = [cross, {**cross, "Origin": "http://127.0.0.1"}, *({"Origin": one} for one in origins)]
    for headers in asked:
        for method, path in (("GET", "/v1/jobs"), ("POST", "/v1/jobs"), ("GET", "/v1/health")):
            answer = api.request(method, path, content=JOB, headers=headers)
            assert answer.status_code == 403, (headers, method, path)
    assert api.get("/v1/jobs").json()["data"] == []
    headers = api.get("/v1/health", headers={"Origin": "http://127.0.0.1"}).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert "access-control-allow-origin" not in headers


def test_a_link_on_another_site_opens_a_page_and_nothing_else(api) -> None:
    for path in ("/", "/sweeps/sweep_1", "/jobs/job_1?view=trial", "/models/a/b"):
        answer = api.get(path, headers=LINK)
        assert answer.status_code == 200
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert "access-control-allow-origin" not in answer.headers
    refused = [
        *(("GET", path, {}) for path in ("/v1/jobs", "/v1/health", "/docs", "/openapi.json")),
        *(("GET", path, {}) for path in ("/jobs/%0A", "//v1/jobs", "/assets/index.js")),
        *((method, path, {}) for method, path in (("POST", "/jobs"), ("POST", "/"))),
        ("HEAD", "/jobs", {}),
        *(("GET", "/jobs", {"Sec-Fetch-Dest": to}) for to in ("iframe", "script")),
        *(("GET", "/jobs", {"Sec-Fetch-Mode": mode}) for mode in ("no-cors", "cors", "")),
        *(("GET", "/jobs", {"Origin": page}) for page in ("http://evil.example", "null")),
    ]
    for method, path, headers in refused:
        answer = api.request(method, f"{api.base_url}{path}", headers=LINK | headers)
        assert answer.status_code == 403, (method, path, headers)


def test_deep_bodies_and_long_numbers_are_refused(api) -> None:
    for opening, closing in (("[", "]"), ('{"a":', "}")):
        for depth in (64, 65, 900, 100_000):
            for body in (opening * depth, opening * depth + "1" + closing * depth):
                answer = api.post("/v1/jobs", content=body, headers=JSON)
                assert answer.status_code == 422
                assert ("64 arrays or objects" in answer.json()["detail"]) is (depth > 64), depth
    number = JOB.replace(b"}", b', "seed": ' + b"9" * 5000 + b"}")
    for body in (number, b"", b"{", b"[]", b"null", b'"x"', b"\xff\xfe"):
        answer = api.post("/v1/jobs", content=body, headers=JSON)
        assert (answer.status_code, answer.headers["content-type"]) == (422, PROBLEM), body[:20]


def test_oversized_bodies_are_refused_whatever_they_say_of_their_size(api) -> None:
    large = [b"x" * 100_000 for _ in range(50)]
    for content in (b"".join(large), iter(large)):
        answer = api.post("/v1/sweeps", content=content)
        assert (answer.status_code, answer.headers["content-type"]) == (413, PROBLEM)


def test_a_method_that_a_path_has_not_is_405_before_the_key_is_asked_for(api, guarded) -> None:
    for template, operations in CONTRACT["paths"].items():
        known = {method.upper() for method in operations}
        known |= {"HEAD"} if "GET" in known else set()
        path = re.sub(r"\{[a-z_]+\}", "x", template.replace("{artifact}", "machine"))
        for method in sorted(METHODS - known)[:3]:
            answer = api.request(method, path)
            assert answer.status_code == 405, (method, path)
            assert set(answer.headers["allow"].split(", ")) == known
    assert guarded.get("/v1/jobs/job_x/cancel").status_code == 405
    assert guarded.delete("/v1/jobs").status_code == 405
    assert guarded.get("/v1/nothing").status_code == 404


def test_paths_names_and_parameters_are_matched_whole(api) -> None:
    for path in ("/v1/jobs", "/v1/tasks/support-1", "/v1/health"):
        assert api.get(path).status_code == 200
        for ending in ("%0A", "%0D%0A", "%00"):
            assert api.get(path + ending).status_code == 404, (path, ending)
    for path in ("/v1/jobs?id_prefix=job_0%0A", "/v1/tasks/lift-1?version=0%0A"):
        assert api.get(path).status_code == 422, path
    for path, body, field in (
        ("/v1/sessions", {"task": "support-1", "agent": "me\n"}, "agent"),
        ("/v1/sessions", {"task": "support-1\n", "agent": "me"}, "task"),
        ("/v1/sweeps", {**SWEEP, "name": "x\n"}, "name"),
        ("/v1/sweeps", {**SWEEP, "name": "a\0b"}, "name"),
        ("/v1/sweeps", {**SWEEP, "name": ""}, "name"),
        ("/v1/jobs", {"task": "support-1\n", "model": "builtin/idle"}, "task"),
        ("/v1/keys", {"name": "ada\n", "scopes": ["read"]}, "name"),
    ):
        answer = api.post(path, json=body)
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, field), body


def test_what_nobody_has_in_a_path_is_404(api) -> None:
    bodies = {"budget": {}, "calls": {"tool": "start"}, "rotate": {}}
    failed = []
    for template in (one for one in CONTRACT["paths"] if "{" in one):
        for name in ("job_0a1b2c3d4e5f60718293", "x" * 300, "%22", "..%2F"):
            path = re.sub(r"\{[a-z_]+\}", name, template)
            for method in CONTRACT["paths"][template]:
                body = bodies.get(path.rpartition("/")[2])
                status = api.request(method.upper(), path, json=body).status_code
                if status != 404 and not (status == 405 and "%2F" in name):
                    failed.append((method, path, status))
    assert not failed
    for path in ("/v1/jobs?sweep=x", "/v1/nothing", "/v1/jobs/a%00b"):
        assert api.get(path).headers["content-type"] == PROBLEM
