"""A sweep while everything around it is killed again and again: nothing is lost or done twice."""

import json
import math
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path

import httpx
import pytest
from scenarios.chaos.faults import VICTIMS, FaultInjector, skewed_worker
from scenarios.chaos.invariants import audited, find_violations, pick_ups
from sqlalchemy.exc import OperationalError
from support.servers.stacks import running_stack, wait_until

from buildarena_backend.database.database import Database
from buildarena_benchmark import builtin_tasks, score
from buildarena_cli.local.stack import Stack
from buildarena_cli.local.supervisor import ManagedProcess
from buildarena_simulation import simulate

pytestmark = pytest.mark.nightly

JOBS = int(os.environ.get("CHAOS_JOBS", "12"))
EVERY_S = float(os.environ.get("CHAOS_EVERY_S", "2.5"))
STRIKES = math.inf if "CHAOS_JOBS" in os.environ else len(VICTIMS)
"""In `make test` one for each process: a busy machine restarts no more than an idle one."""
LEASE_S = float(os.environ.get("CHAOS_LEASE_S", "3"))
SEED = os.environ.get("CHAOS_SEED", "1")
TASK, ENGINE = "lift-1", "mujoco"
BAR_S = 30


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that Postgres can reach again when it is restarted, as another user.

    Any pytest that starts takes the rights of others from the folder of all tmp_paths.
    """
    with tempfile.TemporaryDirectory(prefix="buildarena-chaos-") as name:
        yield Path(name)


def submitted(client: httpx.Client, payload: dict[str, object], key: str) -> str:
    """The sweep's id; submitted again with its key until an answer comes."""

    def submit() -> str | None:
        try:
            answer = client.post("/v1/sweeps", json=payload, headers={"Idempotency-Key": key})
        except httpx.TransportError:
            return None
        return answer.json()["id"] if answer.is_success else None

    return str(wait_until(submit, 60, f"sweep {key} is accepted"))


def ended(client: httpx.Client, sweep_id: str) -> bool:
    try:
        answer = client.get(f"/v1/sweeps/{sweep_id}")
    except httpx.TransportError:
        return False
    time.sleep(0.5)
    return answer.status_code == 200 and answer.json()["state"] == "done"


def reachable(database: Database) -> bool:
    try:
        database.require_schema()
    except OperationalError:
        return False
    return True


@contextmanager
def serving_stack(folder: Path, way: str) -> Iterator[tuple[Stack, list[str]]]:
    """A stack whose simulator reaches database and broker, or nothing but the API.

    Yields:
        The stack, and the words that start a further simulator of this kind.
    """
    simulators = (ENGINE,) if way == "database" else ()
    # On a busy machine kills may leave a job no time to make progress; giving up is another
    # rule's test.
    with running_stack(folder, lease_s=LEASE_S, max_faults=1000, simulators=simulators) as stack:
        words = ["buildarena_simworker", "--simulator", ENGINE]
        if way == "api":
            words += ["--api", stack.url]
            stack.supervisor.launch(
                ManagedProcess(name="mujoco worker", start=lambda: started_runner(stack, words))
            )
        yield stack, words


def started_runner(stack: Stack, words: list[str]) -> subprocess.Popen[bytes]:
    """A runner without any settings: what it needs to know stands in its command."""
    ours = {name: value for name, value in os.environ.items() if "BUILDARENA" not in name}
    with (stack.logs / "runner.log").open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", *words], env=ours, stdout=log, stderr=log, cwd="/"
        )


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("way", ["database", "api"])
def test_nothing_is_lost_or_done_twice(folder, play, way) -> None:
    rng = random.Random(SEED)
    jobs = JOBS if way == "database" else max(4, JOBS // 5)
    cheap, dear = jobs - jobs // 4, jobs // 4
    with (
        serving_stack(folder, way) as (stack, simulator),
        closing(Database(stack.environment["BUILDARENA_DATABASE_URL"])) as database,
    ):
        environment, logs = stack.environment, stack.logs
        with (
            httpx.Client(base_url=stack.url, timeout=30) as client,
            skewed_worker(environment, logs / "skewed.log", "buildarena_worker"),
            skewed_worker(environment, logs / "skewed.log", *simulator),
            # A runner must find both its own process and the API alive to make progress.
            FaultInjector(
                stack=stack,
                rng=rng,
                every_s=EVERY_S * (1 if way == "database" else 2),
                most=STRIKES,
            ) as injector,
        ):
            started = time.monotonic()
            common = {"tasks": [TASK], "simulator": ENGINE}
            sweeps = [
                submitted(
                    client, {**common, "models": ["builtin/random"], "samples": cheap}, "cheap"
                ),
                submitted(
                    client, {**common, "models": ["builtin/expert"], "samples": dear}, "dear"
                ),
            ]
            for sweep_id in sweeps:
                wait_until(lambda: ended(client, sweep_id), 3000, f"{sweep_id} ended")
            injector.stop()
            seconds = time.monotonic() - started
        wait_until(lambda: reachable(database), 60, "the last kill is over")
        wait_until(lambda: audited(database), 300, "all is verified that must be")
        assert find_violations(database) == {}
        picked_up = pick_ups(database, injector.kills)
        with database.transaction() as connection:
            query = "SELECT seed, model, requests, indicator FROM jobs ORDER BY model, seed"
            rows = connection.exec_driver_sql(query).all()
    times = [pick_up.seconds for pick_up in picked_up]
    figures = {
        "jobs": len(rows),
        "seconds": round(seconds, 1),
        "strikes": {
            name: sum(kill.name == name for kill in injector.kills)
            for name in sorted({kill.name for kill in injector.kills})
        },
        "messages_duplicated": injector.duplicates,
        "jobs_of_dead_workers": len(times),
        "median_pick_up_s": round(statistics.median(times), 1) if times else None,
        "longest_pick_up_s": round(times[-1], 1) if times else None,
        "bar_pick_up_s": BAR_S,
        "within_bar": sum(seconds <= BAR_S for seconds in times),
        "slowest": [asdict(pick_up) for pick_up in picked_up[-5:]],
    }
    sys.stdout.write(json.dumps(figures) + "\n")
    assert len(rows) == jobs
    _compare_with_undisturbed(rng.sample(rows, min(6, jobs)), play)


def _compare_with_undisturbed(rows, play) -> None:
    """Same requests and same indicator as in a session that nobody disturbed."""
    task = builtin_tasks()[TASK]
    for row in rows:
        played = play(row.model, task=TASK, seed=row.seed)
        assert row.requests == len(played.entries)
        if played.suspended is not None:
            suspended = played.suspended
            trajectory = simulate(
                suspended.machine, task.scenario, engine=ENGINE, controls=suspended.controls
            )
            assert row.indicator == score(task, suspended.machine, trajectory).indicator
