"""What turns and seconds of sessions cost each part: processor time, transactions, log, bytes.

Runs a whole service whose models answer after a while, and counts what its processes, Postgres and
Valkey used for the jobs of one sweep. The sizing model (sizing_model.py) multiplies these costs.

Two runs with models of two latencies tell turns from waiting. What is used until the last session
has ended is compared; what comes after, when trials still run, is each turn's.
"""

import argparse
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import psutil
import psycopg
from benchmarks.figures import tell
from redis import Redis
from support.providers.stand_in import ProviderStandIn
from support.servers.stacks import running_stack

from buildarena_cli.local.stack import Stack

PARTS = ("postgres", "valkey", "api", "construct worker", "mujoco worker")
LEASE_S = 10.0
IDLE_S = 30.0
OF_TRIALS = ("mujoco worker cpu_ms", "artifact bytes", "postgres stored bytes")
"""What does not depend on how long sessions wait; trials go on after the last session."""
POLL_S = 2.0
"""Rarely: whoever asks uses the service too."""
SWEEP = {"tasks": ["support-1"], "models": ["standin/expert"], "simulator": "mujoco"}


def main() -> None:
    """Measures and prints JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=40)
    parser.add_argument("--latencies", type=float, nargs=2, default=(0.5, 4.0))
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    with (
        tempfile.TemporaryDirectory(prefix="buildarena-costs-") as name,
        ProviderStandIn("expert") as standin,
    ):
        folder = Path(name)
        models = folder / "models.yaml"
        models.write_text(
            f"providers:\n  standin: {{protocol: openai, base_url: '{standin.url}/v1'}}\n"
            "models:\n  - {name: standin/expert, provider: standin, model: expert}\n"
        )
        settings = {"models_file": models, "sessions_per_worker": given.jobs, "lease_s": LEASE_S}
        with running_stack(folder, **settings) as stack:
            one_run(stack, list(range(8)), {})
            before = used(stack)
            time.sleep(IDLE_S)
            idle = {name: value / IDLE_S for name, value in _less(used(stack), before).items()}
            runs = []
            for number, latency_s in enumerate(given.latencies):
                standin.latency_s = latency_s
                first = 100 + number * given.jobs
                runs.append(one_run(stack, list(range(first, first + given.jobs)), idle))
    figures = {"jobs": given.jobs, "lease_s": LEASE_S, "idle_per_s": idle, **fitted(*runs)}
    tell(figures, given.json)


@dataclass(frozen=True, slots=True, kw_only=True)
class OneRun:
    """A sweep that was run.

    Attributes:
        turns: Model requests of all its jobs.
        jobs: How many jobs.
        session_s: Seconds of all its sessions together.
        used: What the service used beyond what it uses idle, until the last session ended.
        later: The same from then until the last trial ended.
    """

    turns: int
    jobs: int
    session_s: float
    used: Mapping[str, float]
    later: Mapping[str, float]


def one_run(stack: Stack, seeds: list[int], idle: Mapping[str, float]) -> OneRun:
    """Runs a sweep whose sessions are all at once, and takes off what an idle service uses."""
    spec = {**SWEEP, "name": f"seeds from {seeds[0]}", "seeds": seeds}
    times, amounts = [time.monotonic()], [used(stack)]

    def note() -> None:
        times.append(time.monotonic())
        amounts.append(used(stack))

    def beyond(place: int) -> dict[str, float]:
        spent = _less(amounts[place + 1], amounts[place])
        seconds = times[place + 1] - times[place]
        return {name: value - idle.get(name, 0.0) * seconds for name, value in spent.items()}

    with httpx.Client(base_url=stack.url, timeout=60) as client:
        sweep = client.post("/v1/sweeps", json=spec).raise_for_status().json()["id"]
        while _open_sessions(stack):
            time.sleep(POLL_S)
        note()
        while client.get(f"/v1/sweeps/{sweep}").json()["state"] != "done":
            time.sleep(POLL_S)
        note()
        listed = client.get("/v1/jobs", params={"sweep": sweep, "limit": 1000}).json()["jobs"]
    return OneRun(
        turns=sum(int(job["usage"]["requests"]) for job in listed),
        jobs=len(seeds),
        session_s=(times[1] - times[0]) * len(seeds),
        used=beyond(0),
        later=beyond(1),
    )


def fitted(short: OneRun, long: OneRun) -> dict[str, Any]:
    """Costs of a turn and of a second that a session lasts, from runs of two latencies."""
    by_turn, by_second = {}, {}
    turns = short.turns + long.turns
    seconds = long.session_s / long.turns - short.session_s / short.turns
    for name in sorted(short.used):
        later = short.later[name] + long.later[name]
        if name in OF_TRIALS:
            by_second[name] = 0.0
            by_turn[name] = (short.used[name] + long.used[name] + later) / turns
            continue
        low, high = short.used[name] / short.turns, long.used[name] / long.turns
        by_second[name] = max((high - low) / seconds, 0.0)
        own = low - by_second[name] * short.session_s / short.turns
        by_turn[name] = max(own, 0.0) + max(later, 0.0) / turns
    return {
        "turns_per_job": round(short.turns / short.jobs, 1),
        "per_turn": by_turn,
        "per_session_s": by_second,
    }


def _less(after: Mapping[str, float], before: Mapping[str, float]) -> dict[str, float]:
    return {name: value - before[name] for name, value in after.items()}


def _open_sessions(stack: Stack) -> int:
    with psycopg.connect(stack.environment["BUILDARENA_DATABASE_URL"]) as database:
        query = "SELECT count(*) FROM jobs WHERE stage = 'construct' AND state <> 'done'"
        row = database.execute(query).fetchone()
    assert row
    return int(row[0])


def used(stack: Stack) -> dict[str, float]:
    """Everything used so far."""
    found: dict[str, float] = {}
    for managed in stack.supervisor.managed:
        if managed.process is not None and managed.name in PARTS:
            found[f"{managed.name} cpu_ms"] = 1000 * cpu_s(managed.process.pid)
    with psycopg.connect(stack.environment["BUILDARENA_DATABASE_URL"]) as database:
        row = database.execute(
            "SELECT xact_commit + xact_rollback, blks_read + blks_hit FROM pg_stat_database "
            "WHERE datname = current_database()"
        ).fetchone()
        log = database.execute("SELECT pg_current_wal_lsn() - '0/0'::pg_lsn").fetchone()
        size = database.execute("SELECT pg_database_size(current_database())").fetchone()
        assert row
        assert log
        assert size
        found |= {
            "postgres transactions": float(row[0]),
            "postgres log bytes": float(log[0]),
            "postgres stored bytes": float(size[0]),
        }
    with Redis.from_url(stack.environment["BUILDARENA_BROKER_URL"]) as valkey:
        facts: dict[str, Any] = valkey.info()
        found["valkey commands"] = float(facts["total_commands_processed"])
    artifacts = Path(stack.settings.data) / "artifacts"
    found["artifact bytes"] = float(
        sum(file.stat().st_size for file in artifacts.rglob("*") if file.is_file())
    )
    return found


def cpu_s(pid: int) -> float:
    """Processor time of a process and all that it started."""
    process = psutil.Process(pid)
    every = [process, *process.children(recursive=True)]
    times = [one.cpu_times() for one in every]
    # Those of children that are gone are their parent's.
    return float(sum(t.user + t.system + t.children_user + t.children_system for t in times))


if __name__ == "__main__":
    main()
