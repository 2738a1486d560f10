"""Machines that come as files: looked at, tried, refused in words, and read in a process apart."""

import json
import os
import signal
import zlib
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import psutil
import pytest
from support.clients.tenants import WITH_KEYS, Tenant, new_tenant
from support.machine_files import published_files
from support.machines.building import BLOCK, built
from support.servers.live_api import live_api
from support.servers.stacks import wait_until
from support.warm_work import work

from buildarena_api import machine_uploads
from buildarena_api.checking import Checker
from buildarena_api.machine_uploads import MAX_BYTES, read_uploaded, shared_checker
from buildarena_backend.errors import UploadError
from buildarena_backend.jobs import files
from buildarena_geometry import Machine
from buildarena_simulation.constants import MAX_PARTS

TRIAL = {"task": "support-1", "simulator": "mujoco"}
SPARE = 200 << 20


def bridge(length: int = 4) -> Machine:
    return built(*((str(n), "E" if n == 1 else "A", BLOCK) for n in range(1, length)))


def written(**change: object) -> bytes:
    return json.dumps({**bridge().to_document(), **change}).encode()


def check(api, data: bytes, **params: str):
    return api.post("/v1/machines/check", content=data, params=params)


def attempt(api, data: bytes, **params: object):
    return api.post("/v1/machines/trials", content=data, params={**TRIAL, **params})


def test_a_machine_is_looked_at(api) -> None:
    machine = bridge()
    seen = check(api, written()).json()
    assert (seen["parts"], seen["faults"], seen["detached"]) == (4, [], [])
    assert seen["mass"] == pytest.approx(machine.mass)
    assert seen["bounds"] == machine.bounds.tolist()
    assert [block["id"] for block in seen["scene"]["blocks"]] == list(machine.blocks)
    assert seen["broken_rule"] is None
    # A broken rule of a task is named, and a file of the game read.
    assert "asks for 2" in check(api, written(), task="lift-3").json()["broken_rule"]
    assert check(api, written(), task="support-1").json()["broken_rule"] is None
    game = check(api, published_files()["single_1_support_hard"]).json()
    assert len(game["scene"]["blocks"]) + len(game["scene"]["connectors"]) == game["parts"] > 3
    for ask, field, bad in (
        *((check, "task", "support-9"), (attempt, "task", "support-9")),
        (attempt, "simulator", "newton"),
    ):
        answer = ask(api, written(), **{field: bad})
        (issue,) = answer.json()["errors"]
        assert (answer.status_code, issue["field"], bool(issue["choices"])) == (422, field, True)


def hostile() -> dict[bytes, str]:
    """Files, and what is said of each."""
    blocks = bridge().to_document()["blocks"]
    twice = [*blocks[:2], {**blocks[2], "position": blocks[1]["position"]}, *blocks[3:]]
    unknown = [blocks[0], {**blocks[1], "module": "<img src=x onerror=alert(1)>"}, *blocks[2:]]
    return {
        b"": "neither a machine document",
        bytes(range(256)) * 40: "neither a machine document",
        b"[]": "neither a machine document",
        b'[{"op": "start"}]': "neither a machine document",
        b'{"a": 1}': "neither a machine document",
        zlib.compress(b"0" * 1_000_000): "neither a machine document",
        b"glTF\x02\x00\x00\x00": "shapes only",
        b'{"blocks": ' + b"[" * 100_000: "inside each other",
        b'{"blocks":' + b'[{"a":' * 80 + b"1" + b"}]" * 80 + b"}": "inside each",
        b'{"blocks": ' + b"9" * 9000 + b"}": "digits",
        written(blocks=twice): "overlap",
        written(blocks=unknown): "Small Wooden Block",
        written().replace(b'"next_id": 5', b'"next_id": NaN'): "next_id",
        written(version=99): "version",
        written(blocks=[1] * 30_000): "at most",
        written(available={"a": {"blocks": [1] * 30_000}}): "at most",
        written(control_sequence=[1] * 30_000): "at most",
        b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "b">]><Machine>&b;</Machine>': "",
        b"<html><script>alert(1)</script></html>": "",
    }


def test_hostile_files_are_refused_in_words(api) -> None:
    for data, says in hostile().items():
        for ask in (check, attempt):
            answer = ask(api, data)
            assert answer.status_code == 422, data[:80]
            assert says in answer.json()["detail"]
            assert answer.json()["errors"]
    large = check(api, b" " * (MAX_BYTES + 1))
    assert (large.status_code, f"{MAX_BYTES:,}" in large.json()["detail"]) == (413, True)


def test_a_machine_is_tried_on_no_leaderboard(api, context) -> None:
    answer = attempt(api, written())
    job = answer.json()
    assert (answer.status_code, job["state"], job["stage"]) == (201, "queued", "simulate")
    assert job["model"].startswith("file/")
    assert api.get(f"/v1/jobs/{job['id']}/machine").status_code == 200
    assert api.get(f"/v1/jobs/{job['id']}/scene").json()["machine"] is not None
    context.queues.settle()
    # The reaper may have named it too.
    assert context.queues.waiting("simulate.mujoco") >= 1
    again = attempt(api, written())
    assert (again.status_code, again.json()["id"]) == (200, job["id"])
    other = json.dumps(bridge(3).to_document()).encode()
    others = {a.json()["id"] for a in (attempt(api, other), attempt(api, other, seed=1))}
    assert len({job["id"], *others}) == 3
    ended = attempt(api, written(), task="lift-3").json()
    assert (ended["state"], ended["outcome"]) == ("done", "construction_failed")
    board = api.get("/v1/leaderboard").json()
    assert (board["track"], board["tracks"]) == (None, [])


@pytest.fixture
def tenants(guarded) -> tuple[Tenant, Tenant]:
    return new_tenant(guarded, "mine"), new_tenant(guarded, "other")


def brought(tenant: Tenant, seed: int = 0) -> httpx.Response:
    params = {**TRIAL, "seed": seed}
    return tenant.ask("POST", "/v1/machines/trials", content=written(), params=params)


def test_trials_under_way_are_bounded_for_each_key(tenants, context, monkeypatch) -> None:
    monkeypatch.setattr(files, "MAX_OPEN", 2)
    mine, other = tenants
    # An equal one takes no place, and one that is opened again takes one.
    first, *rest = (brought(mine, seed) for seed in (0, 1, 0))
    assert [first.status_code, *(answer.status_code for answer in rest)] == [201, 201, 200]
    mine.post(f"/v1/jobs/{first.json()['id']}/cancel", status=200)
    assert brought(mine, 2).status_code == 201
    assert brought(mine, 0).status_code == 429
    assert mine.get(f"/v1/jobs/{first.json()['id']}")["outcome"] == "cancelled"
    # So does one that errored and is tried again.
    job = brought(other, 7).json()["id"]
    lease = context.store.leases.claim("simulate.mujoco", owner="w", only=[other.id])
    assert lease.job.id == job
    context.store.leases.give_up(lease, "no reason", reason="simulator_fault")
    assert [brought(other, seed).status_code for seed in (8, 9)] == [201, 201]
    other.post(f"/v1/jobs/{job}/retry", status=429)
    assert other.get(f"/v1/jobs/{job}")["outcome"] == "errored"


def test_who_cancels_leaves_what_another_wants(tenants) -> None:
    mine, other = tenants
    for seed, first, second in ((0, mine, other), (1, other, mine)):
        job = brought(mine, seed).json()["id"]
        assert brought(other, seed).json()["id"] == job
        assert first.post(f"/v1/jobs/{job}/cancel")["state"] == "queued"
        # The one who left has no say any more; the one who stays has.
        first.post(f"/v1/jobs/{job}/cancel", status=403)
        assert second.post(f"/v1/jobs/{job}/cancel")["outcome"] == "cancelled"


def place(number: int) -> list[float]:
    """One of many places, so far from each other that no blocks overlap."""
    return [3.0 * (number % 13), 3.0 * (number // 13 % 13), 3.0 * (number // 169)]


def many_blocks() -> bytes:
    blocks = bridge().to_document()["blocks"]
    loose = {**blocks[1], "mount": None}
    more = [{**loose, "id": str(n + 2), "position": place(n + 1)} for n in range(MAX_PARTS - 10)]
    return written(blocks=[blocks[0], *more], joints=[], next_id=MAX_PARTS + 1)


def many_connectors() -> bytes:
    end = {"block": "2", "face": "A", "point": [0.0, 0.0, 0.0]}
    connector = {"module": "Brace", "start": end, "end": {**end, "block": "4"}, "bindings": {}}
    return written(connectors=[{**connector, "id": str(n + 5)} for n in range(MAX_PARTS - 10)])


@pytest.mark.ci
def test_bombs_are_answered_in_words_and_leave_the_process_well(api) -> None:
    numbers = ("1e308, 1e308, 1e308", "1e999, 0, 0", "9" * 1_000_000, "1e" + "9" * 1_000_000)
    origin = b'"position": [0.0, 0.0, 0.0]'
    for bomb in (
        *(many_blocks(), many_connectors()),
        *(b'{"blocks":' + b'{"a":' * 300_000, b"<Machine>" + b"<a>" * 400_000),
        *(written().replace(origin, b'"position": [%b]' % n.encode(), 1) for n in numbers),
        written(log=[{"name": "x" * 1_900_000}]),
        written(bindings={str(n): n for n in range(120_000)}),
        b"<Machine " + b" ".join(b'a%d="1"' % n for n in range(150_000)) + b"/>",
    ):
        answer = check(api, bomb)
        assert answer.status_code in {200, 422}, answer.text
        if answer.status_code == 422:
            assert answer.json()["errors"][0]["field"] == "file"
            assert len(answer.json()["detail"]) < 2000
        assert check(api, written()).status_code == 200


@pytest.fixture
def process() -> psutil.Process:
    """The process that reads files, when it is ready."""
    read_uploaded(written())
    return psutil.Process(shared_checker()._process.pid)


@contextmanager
def stopped(process: psutil.Process):
    """While it lasts, the process does nothing."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        if process.is_running():
            process.send_signal(signal.SIGCONT)


def test_others_are_answered_while_a_file_is_read(context, process) -> None:
    served, threads = live_api(context, **WITH_KEYS), ThreadPoolExecutor(4)
    with served as url, httpx.Client(base_url=url, timeout=60) as client, threads:
        mine, other = new_tenant(client, "mine"), new_tenant(client, "other")
        path = "/v1/machines/check"
        with stopped(process):
            checks = [
                threads.submit(who.ask, "POST", path, content=written())
                for who in (mine, mine, other)
            ]
            for who in (mine, other):
                # Nor does it take the lane of heavy questions.
                for asked in ("caller", "jobs?limit=20", "jobs?limit=200"):
                    assert who.ask("GET", f"/v1/{asked}").status_code == 200
            assert not any(check.done() for check in checks)
        assert {check.result().status_code for check in checks} == {200}


@pytest.mark.ci
def test_a_process_that_is_killed_or_slow_loses_nothing(api, context, process, monkeypatch) -> None:
    with ThreadPoolExecutor(1) as threads, stopped(process):
        trying = threads.submit(attempt, api, written())
        wait_until(shared_checker()._lock.locked, 10, "the file is asked about")
        process.kill()
        assert trying.result().status_code == 201
    second = psutil.Process(shared_checker()._process.pid)
    assert second.pid != process.pid
    assert attempt(api, written()).status_code == 200
    assert len(context.store.jobs.page(limit=10)) == 1
    monkeypatch.setattr(shared_checker(), "_longest_s", 0.3)
    with stopped(second):
        answer = check(api, written())
    assert answer.status_code == 422
    assert "it can't be read within" in answer.json()["detail"]
    assert not second.is_running()
    monkeypatch.undo()
    # Nor is a file read in the API's process.
    monkeypatch.setattr(machine_uploads.Machine, "from_document", None)
    monkeypatch.setattr(machine_uploads, "read_machine_file", None)
    assert check(api, written()).status_code == 200


@pytest.mark.ci
def test_a_file_that_kills_its_process_or_takes_its_memory_is_refused() -> None:
    checker = Checker("work", work, spare_bytes=SPARE, longest_s=30)
    first = checker.ask(["pid"])
    for question in (["die"], ["take", 2 * SPARE]):
        with pytest.raises(UploadError, match="memory"):
            checker.ask(question)
    assert checker.ask(["pid"]) not in {first, os.getpid()}
    checker.close()
