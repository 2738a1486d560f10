"""Processor time a job costs besides its session and its simulation, over all processes.

The jobs have a session of one request and a trial of 0.4 s, so that little is to be taken
off. What further turns cost is measured by bench-sessions.
"""

import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import psutil
from support.player import Player
from support.servers.stacks import running_stack

from buildarena_benchmark import load_task, score
from buildarena_simulation import simulate, write_trajectory

HERE = Path(__file__).parent
TASK, WORKFLOW, MODEL, ENGINE = HERE / "one-block.yaml", "one-block", "builtin/idle", "mujoco"
WORKFLOWS = {WORKFLOW: f"{HERE / 'one_block.py'}:OneBlock"}
ALONE = 50
BAR_MS = 15
POLL_S = 2.0
IDLE_S = 5.0


def measure_overhead(jobs: int) -> dict[str, Any]:
    """Runs a sweep through a whole service and takes off what sessions and simulations need.

    What they need is measured here, in one process, over some of the same jobs.
    """
    session_s, simulation_s = _alone()
    payload = {
        "tasks": [WORKFLOW],
        "models": [MODEL],
        "simulator": ENGINE,
        "workflow": WORKFLOW,
        "worlds": 0,
    }
    with (
        tempfile.TemporaryDirectory() as folder,
        running_stack(Path(folder), workflows=WORKFLOWS) as stack,
        httpx.Client(base_url=stack.url, timeout=60) as client,
    ):
        headers = {"Content-Type": "application/yaml"}
        client.post("/v1/tasks", content=TASK.read_bytes(), headers=headers).raise_for_status()
        _run(client, {**payload, "seeds": list(range(jobs, jobs + 20))})  # warm
        idle = _idle_per_second()
        before, started = _processor_s(), time.perf_counter()
        _run(client, {**payload, "samples": jobs})
        wall = time.perf_counter() - started
        used = _processor_s() - before
    per_job = (used.total() - idle.total() * wall) / jobs
    overhead_ms = (per_job - session_s - simulation_s) * 1000
    return {
        "jobs": jobs,
        "jobs_per_second": round(jobs / wall, 2),
        "all_ms_a_job": round(per_job * 1000, 1),
        "session_ms": round(session_s * 1000, 1),
        "simulation_ms": round(simulation_s * 1000, 1),
        "idle_ms_per_second": round(idle.total() * 1000, 1),
        "ms_a_job_by_process": {
            name: round(1000 * (seconds - idle[name] * wall) / jobs, 1)
            for name, seconds in used.most_common()
        },
        "overhead_ms_a_job": round(overhead_ms, 1),
        "bar_ms": BAR_MS,
        "ratio": round(overhead_ms / BAR_MS, 3),
    }


def _run(client: httpx.Client, payload: dict[str, Any]) -> None:
    sweep_id = client.post("/v1/sweeps", json=payload).raise_for_status().json()["id"]
    while True:
        time.sleep(POLL_S)
        progress = client.get(f"/v1/sweeps/{sweep_id}").json()["progress"]
        if progress["done"] == progress["total"]:
            break
    assert list(progress["outcomes"]) == ["unsuccessful"], progress


def _alone() -> tuple[float, float]:
    """Processor seconds of a session, run before and after its simulation, and of that."""
    play = Player()
    task = load_task(TASK)

    def build(seed: int) -> Any:
        return play(MODEL, task=task, seed=seed, workflow=WORKFLOW, workflows=WORKFLOWS)

    suspended = build(0).suspended
    assert suspended is not None

    def try_out(_: int) -> None:
        trajectory = simulate(suspended.machine, task.scenario, engine=ENGINE)
        score(task, suspended.machine, trajectory)
        write_trajectory(trajectory)

    return _timed(build), _timed(try_out)


def _timed(work: Callable[[int], object]) -> float:
    work(0)
    started = time.process_time()
    for seed in range(ALONE):
        work(seed)
    return (time.process_time() - started) / ALONE


def _idle_per_second() -> Counter[str]:
    """What the service's processes use while nothing is asked of them."""
    before = _processor_s()
    time.sleep(IDLE_S)
    used = _processor_s() - before
    return Counter({name: seconds / IDLE_S for name, seconds in used.items()})


def _processor_s() -> Counter[str]:
    """Processor seconds of all child processes, with those that have ended below them."""
    total: Counter[str] = Counter()
    for process in psutil.Process().children(recursive=True):
        times = process.cpu_times()
        words = process.cmdline()
        name = words[2] if words[1:2] == ["-m"] else process.name()
        total[name] += times.user + times.system + times.children_user + times.children_system
    return total
