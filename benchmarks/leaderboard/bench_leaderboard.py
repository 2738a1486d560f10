"""Measures the leaderboard over HTTP handling at 100,000 jobs in a temporary Postgres.

Each question is asked as a reader would: of a board at rest, of a board on which a job has just
ended, and with filters that were never asked for before. A process of its own measures the time
and memory of a full recomputation.
"""

import argparse
import json
import random
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.figures import keep
from sqlalchemy import insert, text, update
from starlette.testclient import TestClient
from support.servers.live_api import LOOPBACK

from buildarena_api.app import create_app
from buildarena_benchmark import builtin_tasks
from buildarena_cli.local import EmbeddedPostgres
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.runtime.logs import set_up_logs
from buildarena_pipeline.runtime.settings import Settings
from buildarena_store import Database
from buildarena_store.tables import jobs

TRACK = "five-role/pybullet-1/default-00000000-1"
CHUNK = 2000


@contextmanager
def database(folder: Path) -> Iterator[str]:
    """A migrated database that is gone afterwards."""
    postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log", durable=False)
    stop = postgres.start()
    try:
        store = Database(postgres.url)
        store.migrate()
        store.close()
        yield postgres.url
    finally:
        postgres.stop(stop)


def fill(context: Context, count: int) -> None:
    """Stores ended jobs: nine tasks, every model of the registry, seeds as needed."""
    rng = random.Random(1)
    tasks, models = builtin_tasks(), sorted(load_registry().models)
    skill = {model: (i + 1) / (len(models) + 1) for i, model in enumerate(models)}
    rows = []
    for number in range(count):
        task = list(tasks)[number % len(tasks)]
        model = models[number // len(tasks) % len(models)]
        won = rng.random() < skill[model] / tasks[task].level
        rows.append(
            {
                "id": f"job_{number:08d}",
                "task": task,
                "task_version": tasks[task].version,
                "model": model,
                "model_hash": f"hash-{model}",
                "model_config": {"name": model, "decoding": {"temperature": 0.5, "top_p": 0.7}},
                "track": TRACK,
                "track_config": {"workflow": "five-role"},
                "seed": number // (len(tasks) * len(models)),
                "stage": "simulate",
                "queue": "simulate.pybullet",
                "state": "done",
                "outcome": "success" if won else "unsuccessful",
                "success": won,
                "indicator": rng.expovariate(0.01) if won else 0.0,
                "metrics": {"parts": rng.randrange(5, 90), "mass": 10.0, "cost": 20},
                "flags": [],
                "refusals": {"overlap": rng.randrange(5), "face_occupied": 1},
                "requests": rng.randrange(20, 200),
                "input_tokens": rng.randrange(10**5, 10**7),
                "output_tokens": rng.randrange(10**4, 10**6),
                "cost_usd": rng.random(),
                "actions": 100,
                "refused_actions": 4,
            }
        )
    with context.store.database.transaction() as connection:
        for start in range(0, count, CHUNK):
            connection.execute(insert(jobs), rows[start : start + CHUNK])
        connection.execute(update(jobs).values(finished_at=jobs.c.created_at))
    with context.store.database.engine.connect() as connection:
        connection.execution_options(isolation_level="AUTOCOMMIT").execute(text("VACUUM ANALYZE"))


def timed(work: Callable[[int], object], times: int) -> list[float]:
    """Seconds that each call took."""
    found = []
    for number in range(times):
        start = time.perf_counter()
        work(number)
        found.append(time.perf_counter() - start)
    return found


def spread(seconds: list[float]) -> dict[str, float]:
    """Median and 95th percentile in milliseconds."""
    ordered = sorted(seconds)
    return {
        "median_ms": round(1000 * statistics.median(ordered), 1),
        "p95_ms": round(1000 * ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))], 1),
    }


def peak_mb() -> float:
    """The most memory this process had, in megabytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def settings_of(url: str) -> Settings:
    """Settings without a broker: the leaderboard needs none."""
    return Settings(database_url=url, broker_url="redis://127.0.0.1:1/0")


def measure(url: str, requests: int) -> dict[str, object]:
    """Asks an API in this process; its peak memory is that of an API process."""
    context = open_context(settings_of(url))
    # No lifespan: the reaper would look for a broker.
    api = TestClient(create_app(context, load_registry()), base_url=LOOPBACK)
    tasks = list(builtin_tasks())

    def ask(params: dict[str, object] | None = None, **headers: str) -> None:
        answer = api.get("/v1/leaderboard", params=params, headers=headers)
        assert answer.status_code in {200, 304}, answer.text

    def end_a_job(number: int) -> None:
        with context.store.database.transaction() as connection:
            connection.execute(
                update(jobs)
                .where(jobs.c.id == f"job_{number * 37:08d}")
                .values(indicator=1.0 + number)
            )

    changed = []
    start = time.perf_counter()
    ask()
    full = time.perf_counter() - start
    memory = {"peak_after_full_mb": round(peak_mb())}
    resting = timed(lambda _: ask(), requests)
    for number in range(requests):
        end_a_job(number)
        changed += timed(lambda _: ask(), 1)
    filtered = timed(
        lambda n: ask({"task": tasks[n % 9], "model": sorted(load_registry().models)[n % 15]}),
        min(requests, 135),
    )
    memory["peak_mb"] = round(peak_mb())
    etag = api.get("/v1/leaderboard").headers["etag"]
    known = timed(lambda _: ask(**{"If-None-Match": etag}), requests)
    mixed = sorted(resting + changed + filtered + known)
    kept = api.get("/v1/leaderboard").content
    other = TestClient(create_app(context, load_registry()), base_url=LOOPBACK)
    start = time.perf_counter()
    equal = other.get("/v1/leaderboard").content == kept
    again = time.perf_counter() - start
    context.close()
    return {
        "full_recomputation_s": round(full, 2),
        "second_recomputation_s": round(again, 2),
        "equal_to_full_recomputation": equal,
        "at_rest": spread(resting),
        "after_a_change": spread(changed),
        "new_filters": spread(filtered),
        "not_modified": spread(known),
        "all_requests": spread(mixed),
        "answer_kb": round(len(kept) / 1024),
        **memory,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--jobs", type=int, default=100_000)
    parser.add_argument("--requests", type=int, default=100)
    parser.add_argument("--url", help="Measure a filled database; used for the child process.")
    given = parser.parse_args()
    set_up_logs("warning")
    if given.url:
        sys.stdout.write(json.dumps(measure(given.url, given.requests)))
        return
    folder = Path(tempfile.mkdtemp(prefix="buildarena-bench-"))
    try:
        with database(folder) as url:
            context = open_context(settings_of(url))
            fill(context, given.jobs)
            context.close()
            words = [sys.executable, __file__, "--url", url, "--requests", str(given.requests)]
            done = subprocess.run(words, check=True, capture_output=True, text=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    result = {"jobs": given.jobs, **json.loads(done.stdout)}
    for name, value in result.items():
        sys.stdout.write(f"{name:<30} {value}\n")
    keep(result, given.json)


if __name__ == "__main__":
    main()
