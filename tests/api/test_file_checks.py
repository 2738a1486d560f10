"""Strangers' files are read in a process apart: whatever they hold, others are answered."""

import json
import os
import re
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import psutil
import pytest
from support.clients.tenants import WITH_KEYS
from support.machine_files import published_files
from support.machines.building import BLOCK, built
from support.servers.live_api import changed, live_api
from support.servers.stacks import wait_until
from support.warm_work import make

from buildarena_api.checking import Checker, CheckFailedError
from buildarena_api.machine_uploads import UploadChecker, read_upload, shared_checker
from buildarena_simulation.constants import MAX_PARTS

SPARE = 200 << 20
SPREAD = 3.0
"""Units between blocks, so that none overlap."""


def document() -> dict[str, object]:
    machine = built(*((str(n), "E" if n == 1 else "A", BLOCK) for n in range(1, 4)))
    return json.loads(json.dumps(machine.to_document()))


def place(number: int) -> tuple[float, float, float]:
    return SPREAD * (number % 13), SPREAD * (number // 13 % 13), SPREAD * (number // 169)


def starting_blocks(count: int = MAX_PARTS - 10) -> bytes:
    """A file of the game with nothing but starting blocks, each at a place of its own."""
    text = published_files()["single_1_support_hard"].decode("utf-8-sig")
    blocks = re.findall(r"<Block .*?</Block>", text, re.DOTALL)
    start = next(block for block in blocks if 'id="0"' in block)
    made = []
    for number in range(count):
        x, y, z = place(number)
        where = f'<Position x="{x}" y="{y}" z="{z}" />'
        moved = re.sub(r"<Position[^>]*/>", where, start, count=1)
        guid = f'guid="{number:08d}-0000-0000-0000-000000000000"'
        made.append(re.sub(r'guid="[^"]*"', guid, moved))
    head, tail = text.index(blocks[0]), text.rindex(blocks[-1]) + len(blocks[-1])
    return (text[:head] + "".join(made) + text[tail:]).encode()


def written(**change: object) -> bytes:
    return json.dumps({**document(), **change}).encode()


def many_blocks() -> bytes:
    blocks = document()["blocks"]
    start, block = blocks[0], {**blocks[1], "mount": None}
    more = [
        {**block, "id": str(n + 2), "position": list(place(n + 1))} for n in range(MAX_PARTS - 10)
    ]
    return written(blocks=[start, *more], joints=[], next_id=MAX_PARTS + 1)


def many_connectors() -> bytes:
    end = {"block": "2", "face": "A", "point": [0.0, 0.0, 0.0]}
    connector = {"module": "Brace", "start": end, "end": {**end, "block": "4"}, "bindings": {}}
    return written(connectors=[{**connector, "id": str(n + 5)} for n in range(MAX_PARTS - 10)])


def moved(value: str) -> bytes:
    return written().replace(b'"position": [0.0, 0.0, 0.0]', f'"position": [{value}]'.encode(), 1)


BOMBS = {
    "1,990 starting blocks": starting_blocks,
    "1,990 loose blocks": many_blocks,
    "1,990 connectors": many_connectors,
    "deep arrays": lambda: b'{"blocks": ' + b"[" * 1_000_000,
    "deep objects": lambda: b'{"blocks":' + b'{"a":' * 300_000,
    "a huge number": lambda: moved("1e308, 1e308, 1e308"),
    "an infinite number": lambda: moved("1e999, 0, 0"),
    "a long number": lambda: moved("9" * 1_000_000 + ", 0, 0"),
    "a long exponent": lambda: moved("1e" + "9" * 1_000_000 + ", 0, 0"),
    "a long name": lambda: written(log=[{"name": "x" * 1_900_000}]),
    "many keys": lambda: json.dumps(
        {**document(), "bindings": {str(n): n for n in range(120_000)}}
    ).encode(),
    "deep elements": lambda: b"<Machine>" + b"<a>" * 400_000,
    "many attributes": lambda: (
        b"<Machine " + b" ".join(b'a%d="1"' % n for n in range(150_000)) + b"/>"
    ),
}


@pytest.mark.ci
@pytest.mark.parametrize("name", BOMBS)
def test_bombs_are_answered_in_words_and_leave_the_process_well(api, name) -> None:
    answer = api.post("/v1/machines/check", content=BOMBS[name]())
    assert answer.status_code in {200, 422}, answer.text
    if answer.status_code == 422:
        assert answer.json()["errors"][0]["field"] == "file"
        assert len(answer.json()["detail"]) < 2000
    assert api.post("/v1/machines/check", content=written()).status_code == 200


@pytest.mark.ci
def test_a_file_is_not_read_in_the_apis_process(api, monkeypatch) -> None:
    from buildarena_api import machine_uploads

    def fail(_: object) -> None:
        raise AssertionError("read in the API's process")

    monkeypatch.setattr(machine_uploads.Machine, "from_document", fail)
    monkeypatch.setattr(machine_uploads, "read_machine_file", fail)
    assert api.post("/v1/machines/check", content=written()).status_code == 200


@pytest.fixture
def process() -> psutil.Process:
    """The process that reads files, when it is ready."""
    checker = shared_checker()
    checker.read(written())
    return running(checker)


def running(checker: UploadChecker) -> psutil.Process:
    pid = checker._checker._process.pid
    assert pid is not None
    return psutil.Process(pid)


@contextmanager
def stopped(process: psutil.Process):
    """While it lasts, the process does nothing."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        if process.is_running():
            process.send_signal(signal.SIGCONT)


@pytest.fixture
def clients(context):
    with changed(context, **WITH_KEYS) as own, live_api(own) as url:
        made = []
        for name in ("mine", "other"):
            _, secret = context.store.keys.create(name=name, scopes=["submit"])
            headers = {"Authorization": f"Bearer {secret}"}
            made.append(httpx.Client(base_url=url, headers=headers, timeout=60))
        yield made
        for client in made:
            client.close()


def test_others_are_answered_while_a_file_is_read(clients, process) -> None:
    mine, other = clients
    with ThreadPoolExecutor(4) as threads:
        with stopped(process):
            checks = [
                threads.submit(client.post, "/v1/machines/check", content=written())
                for client in (mine, mine, other)
            ]
            for client in (mine, other):
                assert client.get("/v1/caller").status_code == 200
                assert client.get("/v1/health").status_code in {200, 503}
                assert client.get("/v1/jobs?limit=20").status_code == 200
                # Nor does it take the lane of heavy questions.
                assert client.get("/v1/jobs?limit=1000").status_code == 200
            assert not any(check.done() for check in checks)
        assert {check.result().status_code for check in checks} == {200}


@pytest.mark.ci
def test_a_process_that_is_killed_while_it_reads_loses_nothing(clients, process, context) -> None:
    mine, _ = clients
    params = {"task": "support-1", "simulator": "mujoco"}
    with ThreadPoolExecutor(1) as threads, stopped(process):
        trying = threads.submit(mine.post, "/v1/machines/trials", content=written(), params=params)
        wait_until(shared_checker()._checker._lock.locked, 10, "the file is asked about")
        process.kill()
        assert trying.result().status_code == 202
    assert running(shared_checker()).pid != process.pid
    assert mine.post("/v1/machines/trials", content=written(), params=params).status_code == 200
    assert len(context.store.jobs.page(limit=10)) == 1


@pytest.mark.ci
def test_a_file_that_takes_too_long_is_refused(api, process, monkeypatch) -> None:
    monkeypatch.setattr(shared_checker()._checker, "_longest_s", 0.3)
    with stopped(process):
        answer = api.post("/v1/machines/check", content=written())
    assert answer.status_code == 422
    assert "the file is too much: it can't be read within" in answer.json()["detail"]
    assert not process.is_running()
    monkeypatch.undo()
    assert api.post("/v1/machines/check", content=written()).status_code == 200


@pytest.fixture
def checker():
    made = Checker("work", make, spare_bytes=SPARE, longest_s=30)
    yield made
    made.close()


@pytest.mark.ci
def test_a_file_that_kills_its_process_is_read_twice_and_no_more(checker) -> None:
    first = checker.ask(["pid"])
    with pytest.raises(CheckFailedError, match="memory"):
        checker.ask(["die"])
    assert checker.ask(["pid"]) not in {first, os.getpid()}


@pytest.mark.ci
def test_a_file_that_takes_too_much_memory_is_refused(checker) -> None:
    with pytest.raises(CheckFailedError, match="memory"):
        checker.ask(["take", 2 * SPARE])
    assert checker.ask(["hello"]) == "hello"


def test_what_is_refused_is_told_in_words() -> None:
    assert "neither a machine document" in str(read_upload(b"[]"))
