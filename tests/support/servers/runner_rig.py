"""Runners of tests: real ones, and those that say what they like."""

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import httpx
from sqlalchemy import text
from support.clients.tenants import ADMIN
from support.machines.building import built

from buildarena_backend.agents.submission import request_trial
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.submission.submission import Submissions
from buildarena_backend.trials.simulator import Simulator
from buildarena_benchmark.tasks.loading import parse_custom_task
from buildarena_geometry import Machine
from buildarena_simulation import (
    SIMULATION_VERSION,
    Trajectory,
    engine_version,
    processor,
    simulate,
)
from buildarena_simworker.engines import EngineSimulator
from buildarena_simworker.remote.api import RunnerApi
from buildarena_simworker.remote.slots import Heartbeats, Slot

MUJOCO = {"mujoco": SIMULATION_VERSION}
VERSIONS = {
    "simulation": SIMULATION_VERSION,
    "engine": "mujoco",
    "engine_version": engine_version("mujoco"),
    "processor": dict(processor()),
}


def submitted(
    context: Context, submissions: Submissions, *, owner: str | None = None, **payload: Any
):
    """A job whose machine is built and waits for its trial in MuJoCo."""
    from support.stages import work

    spec = {"task": "lift-1", "model": "builtin/expert", "simulator": "mujoco", **payload}
    job, _ = submissions.submit_job(JobSpec.model_validate(spec), owner=owner)
    work(context, queues=("construct",))
    return context.store.jobs.get(job.id)


SHORT = """
name: short
title: One block, 0.4 s
category: trivial
statement: Build one block.
scenario: {duration_s: 0.4, control: {mode: constant, from_s: 0}}
scoring: {name: thrust}
indicator: {name: thrust_to_weight, unit: "1"}
"""
CARRY = """
name: carry
title: Carry something for 0.8 s
category: trivial
statement: Carry it.
scenario:
  duration_s: 0.8
  cargo: {size: [1, 1, 1], drop_height: 0.5, final_mass: 50, ramp_s: 0.5}
scoring: {name: support, min_time_s: 0.5}
indicator: {name: load, unit: mass}
"""
MISSING = SHORT.replace("name: short", "name: missing").replace(
    "duration_s: 0.4", 'duration_s: 0.4, tracked_blocks: ["99"]'
)
"""Its trial tracks a block that no machine here has."""


def two_blocks() -> Machine:
    """A starting block with one more on it."""
    return built(("1", "C", "Torch"))


def waiting(context: Context, text: str = SHORT, *, seed: int = 0, owner: str | None = None) -> Job:
    """A job that waits for a trial of two blocks in MuJoCo, which takes next to no time."""
    task = parse_custom_task(text, origin="test")
    context.tasks.add(task, text)
    machine = two_blocks()
    asked = {"simulator": "mujoco", "seed": seed, "owner": owner}
    job, _ = request_trial(context, machine, task=task.name, **asked)
    # A runner that waits may have it already.
    assert (job.state, job.queue) in [(at, "simulate.mujoco") for at in ("queued", "running")]
    return job


def true_trajectory(context: Context, job: Job) -> Trajectory:
    """What MuJoCo says of such a job's trial."""
    task = context.tasks.exact(job.task, job.task_version)
    assert task is not None
    return simulate(two_blocks(), task.scenario, "mujoco", seed=job.seed)


def runner_key(context: Context, *simulators: str, **more: Any) -> tuple[str, str]:
    """A new runner key: its id and secret."""
    key, secret = context.store.keys.create(
        name="runner", scopes=["runner"], simulators=list(simulators or ("mujoco",)), **more
    )
    return key.id, secret


@contextmanager
def slot(
    url: str, secret: str | None, simulator: Simulator | None = None, *, name: str = "tests-1.0"
) -> Iterator[Slot]:
    """One slot of a real runner, in this process."""
    stopping = threading.Event()
    api = RunnerApi(url, secret, stopping=stopping)
    about = {"name": name, "simulators": MUJOCO, "versions": {}, "pid": 1}
    facts = api.facts()
    beats = Heartbeats(api, lambda: about, lease_s=facts["lease_s"])
    beats.start()
    try:
        made = {"api": api, "beats": beats, "about": about, "stopping": stopping}
        engine = simulator or EngineSimulator("mujoco")
        yield Slot(**made, simulator=engine, stop_all=lambda _: stopping.set())
    finally:
        stopping.set()
        beats.stop()
        api.close()


@dataclass
class Caller:
    """Somebody who speaks the protocol by hand."""

    url: str
    secret: str | None = None
    name: str = "by-hand"
    more: dict[str, Any] = field(default_factory=dict)

    def ask(self, method: str, path: str, **options: Any) -> httpx.Response:
        headers = {"Authorization": f"Bearer {self.secret}"} if self.secret else {}
        headers |= options.pop("headers", {})
        address = f"{self.url}/v1/runner{path}"
        return httpx.request(method, address, headers=headers, timeout=30, **options)

    def about(self, **more: Any) -> dict[str, Any]:
        return {"name": self.name, "simulators": MUJOCO, **more}

    def lease(self, **more: Any) -> dict[str, Any]:
        """The trial that is leased."""
        # For a moment the reaper may hold the row.
        answer = self.ask("POST", "/leases", json=self.about(**{"wait_s": 5, **more}))
        assert answer.status_code == 200, answer.text
        return answer.json()

    def named(self, lease: dict[str, Any]) -> dict[str, Any]:
        return {"job_id": lease["job_id"], "token": lease["token"]}

    def at(self, lease: dict[str, Any], path: str = "") -> str:
        return f"/leases/{lease['job_id']}/{lease['token']}{path}"

    def upload(self, lease: dict[str, Any], data: bytes) -> str:
        """Uploads a file; the hash that requests name it by."""
        sha256 = hashlib.sha256(data).hexdigest()
        answer = self.ask("PUT", self.at(lease, f"/uploads/{sha256}"), content=data)
        assert answer.status_code == 204, answer.text
        return sha256

    def outcome(self, lease: dict[str, Any], data: bytes | None, **more: Any) -> httpx.Response:
        """The answer to an outcome."""
        hash_ = None if data is None else self.upload(lease, data)
        body = {"trajectory": hash_, "versions": VERSIONS, "wall_s": 1.0, **more}
        return self.ask("POST", self.at(lease, "/outcome"), json=body)


def as_admin(url: str) -> Caller:
    """The operator, who is no runner."""
    return Caller(url, ADMIN)


def ended(context: Context, job: Job) -> Job:
    """The job as it is now, which must be done."""
    now = context.store.jobs.get(job.id)
    assert now.state == "done", now
    return now


def pause_ends(context: Context) -> None:
    """Lets the time pass after which keys get the trials again that they missed."""
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE attempts SET ended_at = ended_at - interval '1 hour'"))
