"""A runner's part spoken by hand: leases a trial, simulates it, and says of it what it likes."""

import json
import secrets
import socket
from typing import Any
from urllib.parse import urlsplit

import httpx
from cachetools import cached
from support.servers.lies import Lie
from support.servers.runner_rig import Caller
from support.servers.stacks import meanwhile

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.scores import simulate_task
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import (
    SIMULATION_VERSION,
    Trajectory,
    processor,
    write_trajectory,
)

ENGINE = "pybullet"
"""The stacks of the scenarios have no worker of this simulator: its trials are the runners'."""
RUNNER = {"name": "runner", "scopes": ["runner"], "simulators": [ENGINE]}
"""The key that a runner of theirs asks for."""
STALLED_BYTES = 4 << 20


def about(name: str, **more: Any) -> dict[str, Any]:
    """What a runner says of itself."""
    return {"name": name, "simulators": {ENGINE: SIMULATION_VERSION}, **more}


def beat(name: str, **more: Any) -> dict[str, Any]:
    """A heartbeat without leases."""
    return about(name, **{"leases": [], "versions": {}, "pid": 1, **more})


def asked(runner: Caller, **options: Any) -> int:
    """The status of a heartbeat; 413 where the service hangs up while the body is on its way."""
    headers = {"Content-Type": "application/json"}
    try:
        return runner.ask("POST", "/heartbeat", headers=headers, **options).status_code
    except httpx.TransportError:
        return 413


def leased(runner: Caller, job: str | None = None) -> dict[str, Any] | None:
    """A lease of this job, or of any; others are given back."""
    answer = runner.ask("POST", "/leases", json=about(runner.name, wait_s=2))
    if answer.status_code != 200:
        return None
    lease: dict[str, Any] = answer.json()
    if job in (None, lease["job_id"]):
        return lease
    runner.ask("POST", runner.at(lease, "/release"))
    return None


def brought(runner: Caller, lease: dict[str, Any], task: str, lie: Lie) -> httpx.Response:
    """The answer to the outcome of a leased trial, changed by a lie."""
    renewed = beat(runner.name, leases=[runner.named(lease)])
    with meanwhile(lambda: asked(runner, json=renewed), every_s=0.5):
        told = lie(_simulated(task, json.dumps([lease["machine"], lease["controls"]])))
        versions = {
            "engine": ENGINE,
            "simulation": SIMULATION_VERSION,
            "engine_version": told.engine_version,
            "processor": dict(processor()),
        }
        return runner.outcome(lease, write_trajectory(told), versions=versions)


def stalled(url: str) -> socket.socket:
    """A connection with an invented key that promises 4 MiB and sends a byte of them."""
    parts = urlsplit(url)
    connection = socket.create_connection((parts.hostname or "", parts.port or 80), 10)
    connection.sendall(
        f"POST /v1/jobs HTTP/1.1\r\nHost: {parts.netloc}\r\nAuthorization: Bearer ba_"
        f"{secrets.token_urlsafe(32)}\r\nContent-Type: application/json\r\n"
        f"Content-Length: {STALLED_BYTES}\r\n\r\n{{".encode()
    )
    return connection


@cached(cache={})
def _simulated(task: str, spoken: str) -> Trajectory:
    document, presses = json.loads(spoken)
    machine = Machine.from_document(document)
    controls = presses and tuple(KeyPress(**press) for press in presses)
    return simulate_task(builtin_tasks()[task], machine, ENGINE, controls=controls)
