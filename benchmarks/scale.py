"""Measures a service with 200,000 ended and as many queued jobs, by a real API process.

Everything is asked over HTTP, but for claims and the reaper's statements, which workers make
themselves. The database is made in a temporary folder and is gone afterwards.
"""

import argparse
import itertools
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
from benchmarks.figures import keep
from benchmarks.filling import TRACKS, Amount, fill
from sqlalchemy import text

from buildarena_backend.database.database import Database
from buildarena_backend.store import Store
from buildarena_cli.local.postgres import EmbeddedPostgres
from buildarena_cli.local.server import EmbeddedValkey, free_port

BARS = {
    "board_at_rest_ms": 20.0,
    "board_after_a_change_ms": 60.0,
    "first_board_s": 5.0,
    "slowest_other_board_ms": 1000.0,
    "api_memory_mb": 300.0,
    "claim_ms": 5.0,
    "list_ms": 100.0,
    "sweeps_ms": 100.0,
    "sweep_of_100000_s": 10.0,
}
SORTS = ("created", "finished", "indicator", "cost")
FILTERS: dict[str, dict[str, Any]] = {
    "none": {},
    "queued": {"state": "queued"},
    "running": {"state": "running"},
    "done": {"state": "done"},
    "errored": {"outcome": "errored"},
    "cancelled": {"outcome": "cancelled"},
    "reason": {"reason": "lost_worker"},
    "flag": {"flag": "never_fell"},
    "frequent flag": {"flag": "unstable"},
    "task": {"task": "lift-1"},
    "model": {"model": "made-up/model-3"},
    "cell": {"task": "lift-1", "model": "made-up/model-3", "track": TRACKS[0]},
    "track": {"track": TRACKS[1]},
    "min_indicator": {"min_indicator": 900},
    "max_indicator": {"max_indicator": -1},
    "sweep": {"sweep": "sweep_ended0"},
    "id_prefix": {"id_prefix": "job_ab12"},
    "rare text": {"text": "zzzz"},
    "part of an id": {"text": "abc123"},
    "common text": {"text": "lift"},
    "task and outcome": {"task": "lift-1", "outcome": "errored"},
}


@contextmanager
def servers(folder: Path) -> Iterator[dict[str, str]]:
    """A migrated database and a broker; yields the settings of programs."""
    postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log", durable=False)
    valkey = EmbeddedValkey(folder / "valkey", folder / "valkey.log")
    database, broker = postgres.start(), valkey.start()
    try:
        store = Database(postgres.url)
        store.migrate()
        store.close()
        yield {
            "BUILDARENA_DATABASE_URL": postgres.url,
            "BUILDARENA_BROKER_URL": valkey.url,
            "BUILDARENA_DATA": str(folder / "data"),
            "BUILDARENA_LOG_LEVEL": "warning",
        }
    finally:
        valkey.stop(broker)
        postgres.stop(database)


@contextmanager
def api_process(settings: dict[str, str]) -> Iterator[tuple[httpx.Client, int, float]]:
    """A real API process: a client of it, its pid, and when it was started."""
    port, started = free_port(), time.perf_counter()
    words = [sys.executable, "-m", "buildarena_api"]
    given = {**os.environ, **settings, "BUILDARENA_PORT": str(port)}
    process = subprocess.Popen(words, env=given, stdout=subprocess.DEVNULL)
    client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=300)
    try:
        while True:
            try:
                client.get("/v1/health")
                break
            except httpx.TransportError:
                if process.poll() is not None:
                    raise RuntimeError("the API ended before it answered") from None
                time.sleep(0.02)
        yield client, process.pid, started
    finally:
        client.close()
        process.terminate()
        process.wait()


def ask(client: httpx.Client, path: str, **params: Any) -> float:
    """Milliseconds that an answer took."""
    start = time.perf_counter()
    answer = client.get(path, params=params)
    took = 1000 * (time.perf_counter() - start)
    if answer.status_code != 200:
        raise RuntimeError(f"{path} {params}: {answer.status_code} {answer.text[:300]}")
    return took


def spread(values: list[float]) -> dict[str, float]:
    """Median and 95th percentile."""
    ordered = sorted(values)
    return {
        "median": round(statistics.median(ordered), 1),
        "p95": round(ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))], 1),
    }


def memory_mb(pid: int) -> float:
    """The most memory that a process had, in megabytes."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))


def measure_boards(settings: dict[str, str], database: Database, times: int) -> dict[str, Any]:
    """Boards of a process that has read no cell, and later ones."""
    with api_process(settings) as (client, pid, started):
        alive = time.perf_counter() - started
        first = ask(client, "/v1/leaderboard") / 1000
        rest = [ask(client, "/v1/leaderboard") for _ in range(times)]
        changed = []
        for number in range(times):
            with database.transaction() as connection:
                connection.execute(text(CHANGE), {"track": TRACKS[0], "skip": 7 * number})
            changed.append(ask(client, "/v1/leaderboard"))
        other = {
            "other_track": ask(client, "/v1/leaderboard", track=TRACKS[1]),
            "sweep": ask(client, "/v1/leaderboard", sweep="sweep_ended0"),
        }
        return {
            "alive_s": round(alive, 1),
            "first_board_s": round(first, 1),
            "board_at_rest_ms": spread(rest),
            "board_after_a_change_ms": spread(changed),
            "other_boards_ms": {name: round(value) for name, value in other.items()},
            "slowest_other_board_ms": round(max(other.values())),
            "api_memory_mb": round(memory_mb(pid)),
        }


def measure_lists(client: httpx.Client) -> dict[str, Any]:
    """Every filter with every order, each asked for three times."""
    found = {}
    for name, params in FILTERS.items():
        for sort, order in itertools.product(SORTS, ("asc", "desc")):
            values = [ask(client, "/v1/jobs", **params, sort=sort, order=order) for _ in range(3)]
            found[f"{name}, {sort} {order}"] = statistics.median(values)
    worst = sorted(found.items(), key=lambda item: -item[1])[:12]
    return {
        "list_ms": spread(list(found.values())),
        "lists_within_100_ms": f"{sum(v <= 100 for v in found.values())} of {len(found)}",
        "worst_lists_ms": {name: round(value) for name, value in worst},
        "sweeps_ms": round(ask(client, "/v1/sweeps"), 1),
        "sweep_ms": round(ask(client, "/v1/sweeps/sweep_ended0"), 1),
        "health_ms": round(statistics.median(ask(client, "/v1/health") for _ in range(5)), 1),
        "metrics_ms": round(ask(client, "/v1/metrics"), 1),
    }


def measure_workers(database: Database, times: int) -> dict[str, Any]:
    """What workers and the reaper ask for."""
    store = Store(database, lease_s=15, max_faults=8)
    leases, waiting = store.leases, store.waiting
    last: list[str | None] = [None]

    def claim() -> None:
        lease = leases.claim("construct", owner="bench", last=last[0])
        last[0] = None if lease is None else lease.job.owner

    return {
        "claim_ms": spread(timed(claim, times)),
        "recover_ms": spread(timed(leases.recover, 10)),
        "waiting_queues_ms": spread(timed(lambda: waiting.queues(50), 10)),
    }


def measure_sweep(client: httpx.Client, jobs: int) -> dict[str, Any]:
    """How long a large sweep takes to be accepted."""
    spec = {
        "name": "large",
        "tasks": ["lift-1", "support-1"],
        "models": ["builtin/idle", "builtin/random", "builtin/expert"][: 1 if jobs < 1000 else 2],
        "seeds": [],
    }
    cells = len(spec["tasks"]) * len(spec["models"])
    spec["seeds"] = list(range(jobs // cells))
    start = time.perf_counter()
    answer = client.post("/v1/sweeps", json=spec)
    took = time.perf_counter() - start
    if answer.status_code != 201:
        raise RuntimeError(answer.text[:500])
    return {"jobs_of_large_sweep": answer.json()["jobs"], "sweep_of_100000_s": round(took, 1)}


def timed(work: Callable[[], object], times: int) -> list[float]:
    """Milliseconds that each call took."""
    found = []
    for _ in range(times):
        start = time.perf_counter()
        work()
        found.append(1000 * (time.perf_counter() - start))
    return found


CHANGE = """
UPDATE jobs SET indicator = indicator + 1 WHERE id = (
    SELECT id FROM jobs WHERE track = :track AND task = 'lift-1' AND outcome = 'success'
    OFFSET :skip LIMIT 1)
"""


def measure(folder: Path, jobs: int) -> dict[str, Any]:
    """Fills a database and measures everything."""
    times = 60 if jobs >= 100_000 else 5
    with servers(folder) as settings:
        database = Database(settings["BUILDARENA_DATABASE_URL"])
        start = time.perf_counter()
        fill(database, Amount(ended=jobs, queued=jobs))
        result: dict[str, Any] = {
            "ended": jobs,
            "queued": jobs,
            "fill_s": round(time.perf_counter() - start),
            **measure_boards(settings, database, times),
            **measure_workers(database, times),
        }
        with api_process(settings) as (client, _, _):
            result |= measure_lists(client)
            result |= measure_sweep(client, min(100_000, jobs))
        with database.statement() as connection:
            size = "SELECT pg_database_size(current_database())"
            result["database_gb"] = round(connection.execute(text(size)).scalar_one() / 1e9, 1)
        database.close()
    result["load_average"] = [round(value, 1) for value in os.getloadavg()]
    result["of_the_bar"] = {
        name: round(figure["p95"] / bar if isinstance(figure, dict) else figure / bar, 2)
        for name, bar in BARS.items()
        if (figure := result.get(name)) is not None
    }
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--jobs", type=int, default=200_000, help="Ended ones, and as many queued")
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="buildarena-bench-"))
    try:
        result = measure(folder, given.jobs)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for name, value in result.items():
        sys.stdout.write(f"{name:<34} {value}\n")
    keep(result, given.json)


if __name__ == "__main__":
    main()
