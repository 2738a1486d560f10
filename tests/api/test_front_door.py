"""What strangers send costs next to nothing, and the service says how it is beside any of it."""

import asyncio
import json
import secrets
import socket
import threading
import time
from collections import Counter
from contextlib import ExitStack, suppress
from functools import wraps
from types import SimpleNamespace
from urllib.parse import urlsplit

import httpx
import pytest
from support.servers.live_api import live_api
from support.servers.stacks import wait_until

from buildarena_api.http import bodies, door, places
from buildarena_api.http.api_key_cache import AT_ONCE, ApiKeyVerifier
from buildarena_api.http.places import MAX_OPEN, OpenRequests

MIB = 1024 * 1024
STRANGERS = 200
HEALTH = b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\n\r\n"
HALF = b"GET /v1/jobs HTTP/1.1\r\nHost: localhost\r\nX-More: "


def in_a_loop(test):
    """Runs an asynchronous test."""

    @wraps(test)
    def run(*args, **kwargs) -> None:
        asyncio.run(test(*args, **kwargs))

    return run


def invented() -> str:
    return "ba_" + secrets.token_urlsafe(32)


@pytest.fixture
def url(guarded_url, monkeypatch):
    monkeypatch.setattr(bodies, "BODY_S", 1.0)
    return guarded_url


def connect(url: str, data: bytes = b"") -> socket.socket:
    parts = urlsplit(url)
    connection = socket.create_connection((parts.hostname, parts.port), timeout=10)
    connection.sendall(data)
    return connection


def begin(url: str, secret: str | None, *, length: int = 4 * MIB, path: str = "/v1/jobs"):
    """A connection that promises a body and sends its first byte."""
    key = "" if secret is None else f"Authorization: Bearer {secret}\r\n"
    head = (
        f"POST {path} HTTP/1.1\r\nHost: localhost\r\n{key}Content-Type: application/json\r\n"
        f"Content-Length: {length}\r\n\r\n{{"
    )
    return connect(url, head.encode())


def status_of(connection: socket.socket) -> int:
    return int(connection.recv(4096).split()[1])


def is_closed(connection: socket.socket, *, within_s: float) -> bool:
    """Whether the service ends a connection in time, without a word."""
    connection.settimeout(within_s)
    try:
        return connection.recv(1) == b""
    except ConnectionError:
        return True
    except TimeoutError:
        return False


def test_health_is_answered_beyond_the_caps_and_nothing_else_is(context, monkeypatch) -> None:
    monkeypatch.setattr(door, "MAX_OF_AN_ADDRESS", 5)
    monkeypatch.setattr(door, "ANTEROOM", 3)
    with live_api(context) as url, ExitStack() as stack:
        held = [stack.enter_context(connect(url, HALF)) for _ in range(5)]
        # Each takes its first look at the door before the next comes.
        silent = [stack.enter_context(connect(url)) for _ in range(3)]
        for wrong in (HALF, HEALTH.replace(b"health", b"jobs"), HEALTH[:-2], b"\x16\x03\x01"):
            assert is_closed(stack.enter_context(connect(url, wrong)), within_s=5), wrong
        assert status_of(stack.enter_context(connect(url, HEALTH))) in {200, 503}
        assert httpx.get(f"{url}/v1/health").status_code in {200, 503}
        # They made room for the probes; those that were there before stay.
        assert all(is_closed(one, within_s=5) for one in silent)
        assert not any(is_closed(one, within_s=0.05) for one in held)
        for one in held:
            one.close()
        wait_until(lambda: answers(f"{url}/v1/models"), 10, "there is room again")


def answers(url: str) -> bool:
    try:
        return httpx.get(url).status_code == 200
    except httpx.TransportError:
        return False


def test_a_trusted_proxys_connections_are_many_clients(context, monkeypatch) -> None:
    monkeypatch.setattr(door, "MAX_OF_AN_ADDRESS", 2)
    with live_api(context, trusted_proxies="127.0.0.0/8") as url, ExitStack() as stack:
        for _ in range(6):
            stack.enter_context(connect(url, HALF))
        assert httpx.get(f"{url}/v1/models").status_code == 200


def test_a_header_that_does_not_come_is_given_up(context, monkeypatch) -> None:
    monkeypatch.setattr(door, "HEADER_S", 0.5)
    with live_api(context) as url, ExitStack() as stack:
        for sent in (b"", HALF, b"\r\n"):
            assert is_closed(stack.enter_context(connect(url, sent)), within_s=5), sent
        # The same of a connection that asked for something before, and drop by drop.
        again = stack.enter_context(connect(url, HEALTH))
        assert status_of(again) in {200, 503}
        dripping = threading.Thread(target=drip, args=(again,))
        begun = time.monotonic()
        dripping.start()
        dripping.join(10)
        assert 0.3 < time.monotonic() - begun < 5
        # Whoever asks within the time is not bound by it.
        kept = stack.enter_context(connect(url, HEALTH))
        assert status_of(kept) in {200, 503}
        time.sleep(0.7)
        kept.sendall(HEALTH)
        assert status_of(kept) in {200, 503}


def drip(connection: socket.socket) -> None:
    """Sends a header byte by byte, until nobody takes it any more."""
    try:
        connection.sendall(b"GET /")
        while True:
            connection.sendall(b"x")
            time.sleep(0.05)
    except OSError:
        pass


def test_large_headers_are_refused_whole_or_in_pieces(context) -> None:
    line = b"GET /v1/models HTTP/1.1\r\nHost: localhost\r\n"
    many = b"".join(b"X-%d: 1\r\n" % number for number in range(99))
    with live_api(context) as url, ExitStack() as stack:
        for sent, status in (
            (line + many + b"\r\n", 200),
            (line + many + b"X-More: 1\r\n\r\n", 431),
            (line + b"X: " + b"x" * 32_000 + b"\r\n\r\n", 200),
            (line + b"X: " + b"x" * 33_000 + b"\r\n\r\n", 431),
            (line + b"X: " + b"x" * 200_000, 431),
            (b"GET /" + b"x" * 40_000, 431),
            (b"nonsense\r\n\r\n", 400),
        ):
            connection = stack.enter_context(connect(url))
            connection.sendall(sent)
            head, _, body = connection.recv(100_000).partition(b"\r\n\r\n")
            assert int(head.split()[1]) == status, (sent[:60], len(sent))
            if status == 431:
                assert b"application/problem+json" in head
                assert "32,768 bytes and 100 fields" in json.loads(body)["detail"]
        endless = stack.enter_context(connect(url, line + b"X: "))
        parts = 0
        with suppress(OSError):
            while parts < 100:
                endless.sendall(b"x" * 8_000)
                parts += 1
                time.sleep(0.02)
        assert parts < 20


def test_who_has_no_good_key_is_answered_before_the_body_comes(url) -> None:
    secrets = [invented(), None, "x" * 40]
    with ExitStack() as stack:
        strangers = [stack.enter_context(begin(url, secrets[n % 3])) for n in range(STRANGERS)]
        statuses = Counter(map(status_of, strangers))
        assert set(statuses) <= {401, 429}
        assert statuses[401] > 0
    assert httpx.get(f"{url}/v1/health").status_code in {200, 503}


def test_a_body_that_stalls_is_given_up_and_a_runners_is_small(url, context) -> None:
    _, slow = context.store.keys.create(name="slow", scopes=["submit"])
    _, runner = context.store.keys.create(name="r", scopes=["runner"], simulators=["mujoco"])
    for secret, length, path, status in (
        (slow, 4 * MIB, "/v1/jobs", 408),
        (runner, 2 * MIB, "/v1/runner/heartbeat", 413),
        (runner, 1 * MIB, "/v1/runner/leases", 413),
    ):
        with begin(url, secret, length=length, path=path) as connection:
            assert status_of(connection) == status, path


def test_large_bodies_of_one_caller_wait_for_each_other(url, context) -> None:
    keys = [context.store.keys.create(name=name, scopes=["submit"])[1] for name in "ab"]
    large = {"tasks": ["support-1"], "models": ["builtin/idle"], "name": "x" * 100_000}
    with ExitStack() as stack:
        stalled = [stack.enter_context(begin(url, keys[0])) for _ in range(4)]
        took = []
        for secret in reversed(keys):
            begun = time.monotonic()
            header = {"Authorization": f"Bearer {secret}"}
            answer = httpx.post(f"{url}/v1/sweeps", json=large, headers=header, timeout=10)
            assert answer.status_code == 422
            took.append(time.monotonic() - begun)
        assert took[0] < 0.6 < took[1]
        assert {status_of(one) for one in stalled} == {408}


class Doors:
    """An application behind the door, whose requests stay open until they are let go."""

    def __init__(self, known: dict[str, str]) -> None:
        self.leave, self.came, self.open = asyncio.Event(), asyncio.Event(), 0
        self.middleware = OpenRequests(self.app, caller_of=lambda scope: known.get(*scope["who"]))

    async def app(self, _scope, _receive, _send):
        self.open += 1
        self.came.set()
        await self.leave.wait()

    async def hold(self, number: int) -> None:
        """Waits until so many requests are open."""
        while self.open < number:
            self.came.clear()
            await self.came.wait()

    async def ask(self, secret: str, address: str = "10.0.0.1", path: str = "/v1/jobs") -> int:
        statuses = []

        async def send(message):
            statuses.append(message.get("status"))

        scope = {"type": "http", "method": "GET", "path": path, "who": (secret, address)}
        await self.middleware(scope, None, send)
        return statuses[0] if statuses else 200


@in_a_loop
async def test_open_requests_are_bounded_and_refusals_held_back(monkeypatch) -> None:
    monkeypatch.setattr(places, "HELD_S", (0.2, 0.3))
    doors = Doors({"mine": "key_1"})
    async with asyncio.TaskGroup() as group:
        for _ in range(MAX_OPEN):
            group.create_task(doors.ask(invented()))
        await doors.hold(MAX_OPEN)
        begun = time.monotonic()
        assert await doors.ask(invented()) == 429
        assert time.monotonic() - begun >= 0.2
        # Others, and probes of health, find nothing of it.
        group.create_task(doors.ask("mine"))
        group.create_task(doors.ask(invented(), "10.0.0.2"))
        group.create_task(doors.ask(invented(), path="/v1/health"))
        await doors.hold(MAX_OPEN + 3)
        doors.leave.set()
    assert not doors.middleware._open


class Keys:
    """Knows some keys, and notes how it is asked."""

    def __init__(self, *good: str) -> None:
        self.good, self.asked, self.at_once, self.most = good, 0, 0, 0
        self._lock = threading.Lock()

    def check(self, secret):
        with self._lock:
            self.asked, self.at_once = self.asked + 1, self.at_once + 1
            self.most = max(self.most, self.at_once)
        time.sleep(0.005)
        with self._lock:
            self.at_once -= 1
        key = SimpleNamespace(id="key_1")
        return SimpleNamespace(key=key, refusal=None) if secret in self.good else None


@in_a_loop
async def test_invented_keys_take_two_connections_and_malformed_ones_none() -> None:
    good = invented()
    keys = Keys(good)
    checks = ApiKeyVerifier(keys)
    found = await asyncio.gather(*(checks.check(invented()) for _ in range(60)))
    assert set(found) == {None}
    assert (keys.asked, keys.most) == (60, AT_ONCE)
    assert await checks.check("no secret of ours") is None
    assert keys.asked == 60
    # One key is asked for once, however many of its requests come together.
    answers = await asyncio.gather(*(checks.check(good) for _ in range(60)))
    assert {answer.key.id for answer in answers} == {"key_1"}
    assert keys.asked <= 60 + AT_ONCE
    assert checks.known(good) == "key_1"
    assert checks.known(invented()) is None
    before = keys.asked
    checks.forget()
    await checks.check(good)
    assert keys.asked == before + 1


def test_a_heartbeat_says_little(url, context) -> None:
    _, secret = context.store.keys.create(name="r", scopes=["runner"], simulators=["mujoco"])
    body = {"name": "lab", "simulators": {"mujoco": "3"}}
    with httpx.Client(base_url=url, headers={"Authorization": f"Bearer {secret}"}) as runner:
        facts = {f"fact {n}": "x" * 450 for n in range(9)}
        assert len(json.dumps(facts)) > 4096
        refused = runner.post("/v1/runner/heartbeat", json={**body, "versions": facts})
        assert refused.status_code == 422
        (issue,) = refused.json()["errors"]
        assert issue["field"] == "versions"
        assert "4,096" in issue["message"]
        small = {"simulation": "3", "note": "x" * 450}
        taken = runner.post("/v1/runner/heartbeat", json={**body, "versions": small})
        assert taken.status_code == 200
