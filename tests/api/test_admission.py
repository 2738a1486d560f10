"""Keys are checked on the headers, and what strangers send costs next to nothing."""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
from collections import Counter
from contextlib import ExitStack
from functools import partial, wraps
from types import SimpleNamespace
from urllib.parse import urlsplit

import httpx
import pytest
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api

from buildarena_api.http import limits, overload
from buildarena_api.http.admission import (
    PLACE,
    BodyBuffers,
    BuffersFullError,
    PacedReceive,
    SlowBodyError,
)
from buildarena_api.http.key_checks import KeyChecks
from buildarena_api.http.limits import BodyLimitMiddleware
from buildarena_api.http.overload import MAX_IN_FLIGHT, OverloadMiddleware
from buildarena_api.http.weights import Weights
from buildarena_backend.accounts.keys import secret_hash
from buildarena_backend.process.context import open_context

MIB = 1024 * 1024
STRANGERS = 200


def in_a_loop(test):
    """Runs an asynchronous test."""

    @wraps(test)
    def run(*args, **kwargs) -> None:
        asyncio.run(test(*args, **kwargs))

    return run


def invented() -> str:
    return "ba_" + secrets.token_urlsafe(32)


@pytest.fixture
def url(context, monkeypatch):
    monkeypatch.setattr(limits, "PacedReceive", partial(PacedReceive, window_s=0.5))
    guarded = open_context(context.settings.model_copy(update=WITH_KEYS), pool_size=10)
    with live_api(guarded) as found:
        yield found
    guarded.close()


def begin(url: str, secret: str | None, *, length: int = 4 * MIB, path: str = "/v1/jobs"):
    """A connection that promises a body and sends its first byte."""
    parts = urlsplit(url)
    connection = socket.create_connection((parts.hostname, parts.port), timeout=10)
    key = "" if secret is None else f"Authorization: Bearer {secret}\r\n"
    connection.sendall(
        f"POST {path} HTTP/1.1\r\nHost: {parts.netloc}\r\n{key}Content-Type: application/json\r\n"
        f"Content-Length: {length}\r\n\r\n{{".encode()
    )
    return connection


def status_of(connection: socket.socket) -> int:
    return int(connection.recv(4096).split()[1])


def test_who_has_no_good_key_is_answered_before_the_body_comes(url) -> None:
    secrets = [invented(), None, "x" * 40]
    with ExitStack() as stack:
        strangers = [stack.enter_context(begin(url, secrets[n % 3])) for n in range(STRANGERS)]
        statuses = Counter(map(status_of, strangers))
        assert set(statuses) <= {401, 429}
        assert statuses[401] > 0
    assert httpx.get(f"{url}/v1/health").status_code in {200, 503}


@pytest.mark.ci
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


@in_a_loop
async def test_a_body_comes_fast_enough_or_is_given_up() -> None:
    async def comes(*messages: tuple[float, bytes, bool]) -> bool:
        waiting = iter(messages)

        async def receive():
            pause_s, body, more = next(waiting)
            await asyncio.sleep(pause_s)
            return {"type": "http.request", "body": body, "more_body": more}

        paced = PacedReceive(receive, window_s=0.2, window_bytes=1000)
        try:
            while (await paced())["more_body"]:
                pass
        except SlowBodyError:
            return False
        return True

    assert await comes((0.0, b"x", False)), "at once"
    assert await comes(*[(0.1, b"x" * 1000, True)] * 4, (0.1, b"", False)), "steadily"
    assert not await comes((0.0, b"x" * 10**6, True), (9.0, b"", False)), "fast, then never"
    assert not await comes(*[(0.05, b"x", True)] * 100), "drop by drop"


@in_a_loop
async def test_what_bodies_take_is_bounded_for_each_and_for_all_and_given_back() -> None:
    buffers = BodyBuffers(most=250, most_each=100)
    async with buffers.share("a") as take:
        take(100)
        with pytest.raises(BuffersFullError) as own:
            take(1)
        async with buffers.share("b") as others, buffers.share("c") as third:
            others(100)
            with pytest.raises(BuffersFullError) as everybodys:
                third(51)
            third(50)
    assert (own.value.is_of_the_caller, everybodys.value.is_of_the_caller) == (True, False)
    assert buffers.total == 0
    async with buffers.share("a") as take:
        take(100)


@in_a_loop
async def test_a_body_beyond_the_bounds_is_refused() -> None:
    sent: list = []

    async def app(_scope, receive, _send):
        sent.append(await receive())

    async def receive():
        return {"type": "http.request", "body": b"1" * 40, "more_body": False}

    async def send(message):
        sent.append(message)

    async def admit(_scope):
        return None

    scope = {"type": "http", "path": "/", "headers": [(b"content-length", b"40")], "client": None}
    for most, each, status in ((1000, 30, 429), (30, 1000, 503), (1000, 1000, None)):
        sent.clear()
        buffers = BodyBuffers(most=most, most_each=each)
        await BodyLimitMiddleware(app, admit=admit, buffers=buffers)(scope, receive, send)
        if status is None:
            assert [message["body"] for message in sent] == [b"1" * 40]
        else:
            assert sent[0]["status"] == status
            assert b"retry-after" in dict(sent[0]["headers"])


class Doors:
    """An application behind the door, whose requests stay open until they are let go."""

    def __init__(self, known: dict[str, str]) -> None:
        self.leave, self.came, self.places = asyncio.Event(), asyncio.Event(), []
        self.middleware = OverloadMiddleware(self.app, known=known.get, weights=Weights([]))

    async def app(self, scope, _receive, _send):
        self.places.append(scope[PLACE])
        self.came.set()
        await self.leave.wait()

    async def hold(self, number: int) -> None:
        """Waits until so many requests are open."""
        while len(self.places) < number:
            self.came.clear()
            await self.came.wait()

    async def ask(self, secret: str, address: str = "10.0.0.1") -> int | None:
        statuses = []

        async def send(message):
            statuses.append(message.get("status"))

        headers = [(b"authorization", f"Bearer {secret}".encode())]
        scope = {"type": "http", "method": "GET", "path": "/v1/jobs", "headers": headers}
        await self.middleware({**scope, "client": (address, 1)}, None, send)
        return statuses[0] if statuses else None


@in_a_loop
async def test_open_requests_count_by_address_until_a_key_is_known() -> None:
    doors = Doors({"mine": "key_1"})
    async with asyncio.TaskGroup() as group:
        for _ in range(MAX_IN_FLIGHT):
            group.create_task(doors.ask(invented()))
        await doors.hold(MAX_IN_FLIGHT)
        assert await doors.ask(invented()) == 429
        for secret, address in (("mine", "10.0.0.1"), (invented(), "10.0.0.2")):
            group.create_task(doors.ask(secret, address))
        await doors.hold(MAX_IN_FLIGHT + 2)
        # A key that turned out to be good leaves its place of the address to the next.
        doors.places[0].move("key_2")
        group.create_task(doors.ask(invented()))
        await doors.hold(MAX_IN_FLIGHT + 3)
        doors.leave.set()
    assert not doors.places[0].counts


@in_a_loop
async def test_refusals_at_the_door_are_held_back_as_far_as_there_is_room(monkeypatch) -> None:
    doors, waits = Doors({}), []

    async def note(seconds: float) -> None:
        waits.append(seconds)

    monkeypatch.setattr(overload, "MAX_IN_FLIGHT", 0)
    monkeypatch.setattr(overload.asyncio, "sleep", note)
    assert await doors.ask(invented()) == 429
    low, high = overload.HELD_S
    assert low <= waits[0] <= high
    monkeypatch.setattr(overload, "MAX_HELD", 0)
    assert await doors.ask(invented()) == 429
    assert len(waits) == 1


class Pool:
    """Answers key checks, and counts how often it is asked."""

    def __init__(self) -> None:
        self.asked: list[int] = []
        self.good: dict[str, object] = {}
        keys = SimpleNamespace(check_hashes=self.check)
        self.context = SimpleNamespace(store=SimpleNamespace(keys=keys))

    def check(self, digests):
        self.asked.append(len(digests))
        return {digest: self.good[digest] for digest in digests if digest in self.good}

    async def run(self, work, *arguments):
        await asyncio.sleep(0.01)
        return work(*arguments)


@in_a_loop
async def test_invented_keys_cost_few_questions_and_malformed_ones_none() -> None:
    pool = Pool()
    checks = KeyChecks(pool)
    found = await asyncio.gather(*(checks.check(invented()) for _ in range(500)))
    assert set(found) == {None}
    assert sum(pool.asked) == 500
    assert len(pool.asked) <= 3
    assert await checks.check("no secret of ours") is None
    assert sum(pool.asked) == 500


@in_a_loop
async def test_invented_keys_are_looked_up_now_and_then_and_good_ones_at_once(monkeypatch) -> None:
    pool, secret = Pool(), invented()
    pool.good[secret_hash(secret)] = SimpleNamespace(key=SimpleNamespace(id="key_1"), refusal=None)
    checks = KeyChecks(pool)
    assert (await checks.check(secret)).key.id == "key_1"
    monkeypatch.setattr(checks._of_unknown, "_pause_s", 60.0)
    assert await checks.check(invented()) is None
    waiting = [asyncio.create_task(checks.check(invented())) for _ in range(50)]
    for _ in range(3):
        # Whoever is known waits for none of them.
        checks.forget()
        assert (await checks.check(secret)).key.id == "key_1"
    assert not any(task.done() for task in waiting)
    assert sum(pool.asked) <= 6
    for task in waiting:
        task.cancel()


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
