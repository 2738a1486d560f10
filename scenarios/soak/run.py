"""Soak: a service under steady load and steady kills; nothing lost, and no process that grows.

Beside the processes that are killed run some that never are, in which a leak would show. Some of
the jobs are runners' to simulate, among whom are liars; strangers without a key stall meanwhile.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path

import httpx
import psutil
from scenarios.chaos.faults import FaultInjector
from scenarios.chaos.invariants import audited, find_violations
from scenarios.soak.background_load import ENGINE, BackgroundLoad, honest_runner, refuted, suspended
from scenarios.soak.memory import MEBI, Watch, growth
from support.clients.tenants import ADMIN, WITH_KEYS, Tenant, new_tenant, operator
from support.servers.api_process import answers
from support.servers.stacks import running_stack, wait_until

from buildarena_backend.database.database import Database
from buildarena_cli.local.server import free_port
from buildarena_cli.local.stack import Stack

BATCH = 100
MIX = (("builtin/random", 0.6), ("builtin/idle", 0.3), ("builtin/expert", 0.1))
"""Models and their shares: most sessions end early, a tenth is simulated."""
RUNNERS_EVERY = 20
"""Every so many batches is the runners': experts in a simulator that no worker of the stack has."""
MAX_MIB = 400
SAMPLE_S = 5.0
READ_EVERY_S = 0.5
STEADY = {
    "api, never killed": ("buildarena_api",),
    "construct worker, never killed": ("buildarena_worker",),
    "simulation worker, never killed": ("buildarena_simworker", "--simulator", "mujoco"),
}


@contextmanager
def steady_processes(stack: Stack, port: int) -> Iterator[dict[str, psutil.Process]]:
    """A further process of each kind, which nobody kills."""
    environment = {**stack.environment, "BUILDARENA_PORT": str(port)}
    with ExitStack() as ended:
        found = {}
        for name, words in STEADY.items():
            log = ended.enter_context((stack.logs / f"{words[0]}-steady.log").open("ab"))
            process = subprocess.Popen(
                [sys.executable, "-m", *words], env=environment, stdout=log, stderr=log
            )
            ended.callback(process.wait, timeout=60)
            ended.callback(process.terminate)
            found[name] = psutil.Process(process.pid)
        yield found


def processes_of(stack: Stack, steady: Mapping[str, psutil.Process]) -> dict[str, psutil.Process]:
    """Processes by name: steady ones, those that are killed, and their children."""
    parents = dict(steady)
    for managed in stack.supervisor.managed:
        if managed.process is not None:
            with suppress(psutil.Error):
                parents[f"{managed.name}, killed"] = psutil.Process(managed.process.pid)
    found = dict(parents)
    for name, process in parents.items():
        if name.startswith("postgres"):
            continue  # a child for each connection, which says nothing of ours
        with suppress(psutil.Error):
            for number, child in enumerate(sorted(process.children(), key=lambda c: c.pid), 1):
                found[f"{name}: child {number}"] = child
    return found


class Reader(threading.Thread):
    """Reads lists, sweeps, boards and streams of the API that is never killed, as dashboards do."""

    def __init__(self, url: str, sweeps: list[str]) -> None:
        super().__init__(name="reader")
        self.answers: Counter[int] = Counter()
        self._url, self._sweeps, self._stop_now = url, sweeps, threading.Event()

    def run(self) -> None:
        rng = random.Random(0)
        headers = {"Authorization": f"Bearer {ADMIN}"}
        with httpx.Client(base_url=self._url, timeout=60, headers=headers) as client:
            while not self._stop_now.wait(READ_EVERY_S):
                paths = ["/v1/jobs?limit=50", "/v1/sweeps?limit=5", "/v1/health", "/v1/leaderboard"]
                if self._sweeps:
                    sweep = rng.choice(self._sweeps[-20:])
                    paths += [f"/v1/sweeps/{sweep}", f"/v1/jobs?sweep={sweep}"]
                    if rng.random() < 0.1:
                        self._listen(client, sweep)
                with suppress(httpx.TransportError):
                    self.answers[client.get(rng.choice(paths)).status_code] += 1

    def _listen(self, client: httpx.Client, sweep: str) -> None:
        with (
            suppress(httpx.TransportError),
            client.stream("GET", f"/v1/sweeps/{sweep}/events") as stream,
        ):
            for _, _line in zip(range(20), stream.iter_lines(), strict=False):
                pass

    def stop(self) -> None:
        self._stop_now.set()
        self.join()


def submit(url: str, tenant: Tenant, number: int, rng: random.Random) -> str:
    """Submits a batch of jobs to either API, again until it is accepted."""
    model = rng.choices([name for name, _ in MIX], [share for _, share in MIX])[0]
    by_runners = number % RUNNERS_EVERY == 1
    payload = {
        "name": f"soak {number}",
        "tasks": ["lift-1"],
        "models": ["builtin/expert" if by_runners else model],
        "seeds": list(range(number * BATCH, (number + 1) * BATCH)),
        "simulator": ENGINE if by_runners else "mujoco",
        "budget": {"max_requests": 1_000_000},
    }

    def ask() -> str | None:
        with suppress(httpx.TransportError):
            headers = {
                "Idempotency-Key": f"soak-{number}",
                "Authorization": f"Bearer {tenant.secret}",
            }
            answer = httpx.post(f"{url}/v1/sweeps", json=payload, headers=headers, timeout=30)
            return answer.json()["id"] if answer.is_success else None
        return None

    return str(wait_until(ask, 120, f"batch {number} is accepted"))


def ended_jobs(database: Database) -> int:
    with database.statement() as connection:
        query = "SELECT count(*) FROM jobs WHERE state = 'done'"
        return int(connection.exec_driver_sql(query).scalar_one())


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--jobs", type=int, default=20_000)
    parser.add_argument("--every", type=float, default=10, help="seconds between kills")
    parser.add_argument("--json", type=Path)
    return parser.parse_args()


def main() -> int:
    """Runs the soak; 0 when every bar was met."""
    given = _options()
    rng = random.Random(1)
    batches = max(1, given.jobs // BATCH)
    with tempfile.TemporaryDirectory(prefix="buildarena-soak-") as name, ExitStack() as running:
        stack = running.enter_context(running_stack(Path(name), lease_s=5.0, **WITH_KEYS))
        database = Database(stack.environment["BUILDARENA_DATABASE_URL"])
        port = free_port()
        steady = running.enter_context(steady_processes(stack, port))
        url = f"http://127.0.0.1:{port}"
        wait_until(lambda: answers(url), 60, "the steady API answers")
        client = running.enter_context(httpx.Client(base_url=url, timeout=60))
        tenant = new_tenant(client, "soak")
        runner = running.enter_context(honest_runner(url, operator(client), Path(name) / "runner"))
        steady |= {"runner, never killed": runner}
        load = BackgroundLoad(url, operator(client), Path(name))
        load.start()
        running.callback(load.stop)
        sweeps: list[str] = []
        reader = Reader(url, sweeps)
        reader.start()
        running.callback(reader.stop)
        watch = running.enter_context(Watch(lambda: processes_of(stack, steady), every_s=SAMPLE_S))
        injector = running.enter_context(FaultInjector(stack=stack, rng=rng, every_s=given.every))
        started = time.monotonic()
        for number in range(batches):
            due = started + given.seconds * number / batches
            time.sleep(max(0.0, due - time.monotonic()))
            sweeps.append(submit((stack.url, url)[number % 2], tenant, number, rng))
            if number % 10 == 0:
                _tell(f"{number * BATCH} submitted, {len(injector.kills)} kills")
        time.sleep(max(0.0, started + given.seconds - time.monotonic()))
        steady_until = time.monotonic()
        injector.stop()
        load.stop()
        wait_until(lambda: _reachable(database), 60, "the last kill is over")
        lies = _settled(database, tenant, batches * BATCH)
        seconds = time.monotonic() - started
        figures = _figures(database, watch, injector, reader, steady_until)
        figures |= {"crowd": dict(sorted(load.answers.items())), "lies_undone": len(lies)}
        figures |= {"keys_suspended": suspended(database)}
        figures |= {"jobs": batches * BATCH, "seconds": round(seconds)}
        database.close()
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps(figures, indent=1))
    _tell(json.dumps(figures, indent=1))
    return int(bool(figures["failures"]))


def _settled(database: Database, tenant: Tenant, jobs: int) -> set[str]:
    """Waits until every job has ended and counts; those whose trial was refuted have it again."""
    lies: set[str] = set()
    while True:
        wait_until(lambda: ended_jobs(database) == jobs, 1800, "every job has ended")
        wait_until(lambda: audited(database), 1800, "all is verified that must be")
        wrong = refuted(database)
        if not wrong:
            return lies
        lies.update(wrong)
        for job in wrong:
            tenant.post(f"/v1/jobs/{job}/retry")


def _figures(
    database: Database, watch: Watch, injector: FaultInjector, reader: Reader, steady_until: float
) -> dict[str, object]:
    """What is told; memory of the time in which the load was steady."""
    wrong = find_violations(database)
    steady = {
        name: [sample for sample in samples if sample[0] <= steady_until]
        for name, samples in sorted(watch.samples.items())
    }
    memory = {name: growth(samples) for name, samples in steady.items() if len(samples) >= 8}
    failures = [f"books: {name}" for name in wrong]
    failures += [
        f"{name} had {found.peak_mib:.0f} MiB"
        for name, found in memory.items()
        if found.peak_mib > MAX_MIB
    ]
    failures += [
        f"{name} grew by {found.growth_mib:.1f} MiB, noise {found.noise_mib:.1f}"
        for name, found in memory.items()
        if found.grows and "never killed" in name
    ]
    return {
        "kills": dict(sorted(Counter(kill.name for kill in injector.kills).items())),
        "messages_duplicated": injector.duplicates,
        "answers_of_the_steady_api": dict(reader.answers),
        "wrong": wrong,
        "memory": {
            name: {key: round(value, 1) for key, value in asdict(found).items()}
            for name, found in memory.items()
        },
        "memory_each_minute": {
            name: [round(size, 1) for _, size in samples[:: round(60 / SAMPLE_S)]]
            for name, samples in steady.items()
            if "never killed" in name
        },
        "bars": {"most_mib": MAX_MIB, "grows": "beyond noise, where never killed"},
        "failures": failures,
        "machine": {
            "processors": os.cpu_count(),
            "memory_mib": psutil.virtual_memory().total // MEBI,
        },
    }


def _reachable(database: Database) -> bool:
    try:
        database.require_schema()
    except Exception:  # noqa: BLE001 - whatever is wrong, it is tried again
        return False
    return True


def _tell(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
