"""Outages as scenarios of the attack: a full disk, a stopped broker, a killed supervisor."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import httpx
import psutil
from redis import Redis
from scenarios.attack.arena import Arena, Tried
from support.servers.stacks import wait_until

from buildarena_cli.local.server import free_port


def full_disk(arena: Arena) -> Tried:
    """Artifacts lie on a small disk that is full for a while."""
    found = Tried("a full disk under the artifacts")
    place = Path(arena.stack.environment["BUILDARENA_ARTIFACTS_URL"])
    if not os.path.ismount(place):
        found.refused = "left out: mounting a small disk needs root"
        return found
    filler = place / "filler"
    with filler.open("wb", buffering=0) as file, suppress(OSError):
        while file.write(b"x" * 65536):
            pass
    body = {"task": "lift-1", "model": "builtin/expert", "simulator": "mujoco", "seed": 3}
    id_ = arena.innocent.post("/v1/jobs", body)["id"]

    def waits() -> bool:
        job = arena.innocent.get(f"/v1/jobs/{id_}")
        return job["faults"] >= 1 and "artifacts can't be written" in (job["detail"] or "")

    wait_until(waits, 30, "the job waits for the disk")

    def shows() -> bool:
        checks = httpx.get(f"{arena.stack.url}/v1/health").json()["checks"]
        return any(check["name"] == "artifacts" and not check["ok"] for check in checks)

    wait_until(shows, 15, "health shows the full disk")
    asked = arena.innocent.get(f"/v1/jobs/{id_}")["usage"]["requests"]
    filler.unlink()
    wait_until(lambda: arena.innocent.get(f"/v1/jobs/{id_}")["state"] == "done", 90, "it ends")
    job = arena.innocent.get(f"/v1/jobs/{id_}")
    found.require(job["outcome"] == "success", f"the job ended as {job['outcome']}")
    found.require(job["usage"]["requests"] == asked, "its model was asked again")
    found.refused = "the job waited, and succeeded when there was room"
    return found


def stopped_broker(arena: Arena) -> Tried:
    """The broker is stopped, not dead: connections hang."""
    seconds = arena.sizes["broker_s"]
    found = Tried(f"the broker stopped for {seconds:.0f} s")
    broker, slowest, number = arena.process("valkey"), 0.0, 0
    broker.send_signal(signal.SIGSTOP)
    try:
        ends = time.monotonic() + seconds
        ids = []
        while time.monotonic() < ends:
            started = time.monotonic()
            body = {"task": "support-1", "model": "builtin/idle", "seed": 5000 + number}
            answer = arena.innocent.ask("POST", "/v1/jobs", json=body)
            slowest = max(slowest, time.monotonic() - started)
            found.require(answer.status_code == 201, f"a submission got {answer.status_code}")
            ids.append(answer.json()["id"])
            number += 1
            time.sleep(0.1)
    finally:
        broker.send_signal(signal.SIGCONT)
    started = time.monotonic()
    wait_until(
        lambda: all(arena.innocent.get(f"/v1/jobs/{id_}")["state"] == "done" for id_ in ids),
        120,
        "all jobs end",
    )
    found.require(slowest < 2.5, f"a submission took {slowest:.1f} s")
    found.refused = (
        f"{number} submissions, the slowest {slowest * 1000:.0f} ms; all done "
        f"{time.monotonic() - started:.0f} s after it went on"
    )
    return found


def flushed_broker(arena: Arena) -> Tried:
    """The broker loses all it has, again and again, while jobs wait."""
    found = Tried("the broker flushed 20 times while jobs wait")
    body = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [*range(9000, 9030)]}
    sweep = arena.innocent.post("/v1/sweeps", {**body, "simulator": "mujoco"})["id"]
    started = time.monotonic()
    with Redis.from_url(arena.stack.environment["BUILDARENA_BROKER_URL"]) as broker:
        for _ in range(20):
            broker.flushall()
            time.sleep(0.1)
    wait_until(
        lambda: arena.innocent.get(f"/v1/sweeps/{sweep}")["progress"]["done"] == 30,
        120,
        "all jobs end",
    )
    jobs = arena.innocent.get(f"/v1/jobs?sweep={sweep}&limit=50")["data"]
    requests = [job["usage"]["requests"] for job in jobs]
    found.require(len(set(requests)) == 1, f"sessions asked {Counter(requests)} times")
    found.refused = f"30 jobs done within {time.monotonic() - started:.0f} s, none run twice"
    return found


def killed_supervisor(arena: Arena) -> Tried:
    """What `buildarena up` started ends when it is killed."""
    found = Tried("kill -9 of `buildarena up`")
    with tempfile.TemporaryDirectory(prefix="buildarena-attack-") as name:
        port = free_port()
        environment = {
            **os.environ,
            "BUILDARENA_DATA": f"{name}/data",
            "BUILDARENA_PORT": str(port),
        }
        words = [sys.executable, "-m", "buildarena_cli", "up"]
        with subprocess.Popen(words, env=environment, stdout=-3, stderr=-3, cwd=name) as process:
            url = f"http://127.0.0.1:{port}/v1/health"
            wait_until(lambda: _ok(url), 60, "the service is up")
            family = psutil.Process(process.pid).children(recursive=True)
            process.kill()
        started = time.monotonic()
        _, alive = psutil.wait_procs(family, timeout=15)
        took = time.monotonic() - started
        found.require(not alive, f"still alive: {[' '.join(p.cmdline())[:80] for p in alive]}")
        for left in alive:
            left.kill()
        found.refused = f"{len(family)} processes ended within {took:.1f} s"
    del arena
    return found


def _ok(url: str) -> bool:
    try:
        return httpx.get(url, timeout=5).json()["status"] == "ok"
    except (httpx.TransportError, ValueError):
        return False
