"""Processor time a job costs beside its session and its simulation, over all processes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import psutil
from player import Player
from running import finished, running_stack

from buildarena_benchmark import builtin_tasks, score
from buildarena_simulation import simulate

TASK, MODEL, ENGINE = "lift-1", "builtin/expert", "mujoco"
ALONE = 10


def measure_overhead(jobs: int) -> dict[str, Any]:
    """Runs a sweep through a whole service and takes off what sessions and simulations need.

    What they need is measured here, in one process, on the same seeds' machines.
    """
    session_s, simulation_s = _alone()
    with (
        tempfile.TemporaryDirectory() as folder,
        running_stack(Path(folder)) as stack,
        httpx.Client(base_url=stack.url, timeout=60) as client,
    ):
        wish = {"tasks": [TASK], "models": [MODEL], "simulator": ENGINE}
        _run(client, {**wish, "seeds": [jobs + 1, jobs + 2]})  # warm
        idle = _idle_per_second()
        before, started = _processor_s(), time.perf_counter()
        _run(client, {**wish, "samples": jobs})
        used = _processor_s() - before
        wall = time.perf_counter() - started
        requests = client.get("/v1/jobs", params={"task": TASK}).json()["jobs"][0]["usage"]
    per_job = (used - idle * wall) / jobs
    overhead_ms = (per_job - session_s - simulation_s) * 1000
    return {
        "jobs": jobs,
        "task": TASK,
        "requests_a_job": requests["requests"],
        "jobs_per_second": round(jobs / wall, 2),
        "all_ms_a_job": round(per_job * 1000, 1),
        "session_ms": round(session_s * 1000, 1),
        "simulation_ms": round(simulation_s * 1000, 1),
        "idle_ms_per_second": round(idle * 1000, 1),
        "overhead_ms_a_job": round(overhead_ms, 1),
        "bar_ms": 25,
        "ratio": round(overhead_ms / 25, 3),
    }


def _run(client: httpx.Client, wish: dict[str, Any]) -> None:
    sweep_id = client.post("/v1/sweeps", json=wish).raise_for_status().json()["id"]
    sweep = finished(client, sweep_id, within_s=900)
    assert list(sweep["progress"]["outcomes"]) == ["success"], sweep["progress"]


def _alone() -> tuple[float, float]:
    """Processor seconds of a session up to its simulation and after it, and of a simulation."""
    play = Player()
    task = builtin_tasks()[TASK]
    play(MODEL, task=TASK)
    session = _timed(lambda seed: play(MODEL, task=TASK, seed=seed))
    machines = [play(MODEL, task=TASK, seed=seed).suspended for seed in range(ALONE)]

    def try_out(seed: int) -> None:
        suspended = machines[seed]
        assert suspended is not None
        trajectory = simulate(
            suspended.machine, task.scenario, engine=ENGINE, controls=suspended.controls
        )
        score(task, suspended.machine, trajectory)
        trajectory.to_parquet()

    return session, _timed(try_out)


def _timed(work: Callable[[int], object]) -> float:
    started = time.process_time()
    for seed in range(ALONE):
        work(seed)
    return (time.process_time() - started) / ALONE


def _idle_per_second() -> float:
    """What the service uses while nothing is asked of it."""
    before = _processor_s()
    time.sleep(5)
    return (_processor_s() - before) / 5


def _processor_s() -> float:
    """Processor seconds of all child processes, with those that have ended below them."""
    total = 0.0
    for process in psutil.Process().children(recursive=True):
        times = process.cpu_times()
        total += times.user + times.system + times.children_user + times.children_system
    return total
