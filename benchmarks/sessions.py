"""How many sessions one construct process carries: 200 at once against a model that takes 1 s.

Prints its figures as JSON. Baseline: the ideal, in which a session takes nothing but its model's
latency. A turn's milliseconds are processor time of the construct process, all its threads
together, over all turns; the database, the broker and the model are other processes.
"""

import argparse
import math
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import psutil
from benchmarks.figures import tell

from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.process.context import Context, open_context
from buildarena_backend.settings import Settings
from buildarena_backend.submission.submission import Submissions
from buildarena_cli.local.postgres import EmbeddedPostgres
from buildarena_cli.local.server import EmbeddedValkey

MEBIBYTE = 1024 * 1024
POLL_S = 0.05
WARM_UP, ANSWERS = 8, 30
"""Sessions before those that count, and what each has of answers at least. What a process loads and
learns once, its code and how many requests the provider takes at a time, is not what a session
costs; it learns one more request with each answer."""
LARGE_FROM = 1000
SMALL, LARGE = (
    {"share_of_ideal": ">= 0.9", "cpu_ms_per_turn": "<= 5", "peak_rss_mib": "< 700"},
    {"share_of_ideal": ">= 0.95", "cpu_ms_per_turn": "<= 3", "peak_rss_mib": "<= 900"},
)


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sessions", type=int, default=200)
    parser.add_argument("--latency", type=float, default=1.0)
    parser.add_argument("--warm-up", type=int, help="sessions before those that count")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        provider = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.standin", str(given.latency)],
            stdout=subprocess.PIPE,
        )
        stack.callback(provider.wait)
        stack.callback(provider.kill)
        assert provider.stdout is not None
        url = provider.stdout.readline().decode().strip()
        service = Service(stack, folder, url, given.sessions)
        warm_up = given.warm_up or max(WARM_UP, math.ceil(given.sessions / ANSWERS))
        _, warm_up_s = service.run([given.sessions + number for number in range(warm_up)])
        os.kill(provider.pid, signal.SIGUSR1)
        figures = _measure(service, provider.pid, given.sessions, given.latency)
        figures["warm_up_s"] = round(warm_up_s, 2)
    tell(figures, given.json)


class Service:
    """A database, a broker and one construct worker, stopped with the stack."""

    def __init__(self, stack: ExitStack, folder: Path, url: str, sessions: int) -> None:
        self.context, environment, registry_file = _backends(stack, folder, url, sessions)
        self._log = folder / "worker.log"
        log = stack.enter_context(self._log.open("wb"))
        self.worker = subprocess.Popen(
            [sys.executable, "-m", "buildarena_worker"], env=environment, stdout=log, stderr=log
        )
        stack.callback(self.worker.wait)
        stack.callback(self.worker.terminate)
        while not [w for w in self.context.store.workers.page(limit=100) if w.alive]:
            time.sleep(POLL_S)
        self._submissions = Submissions(self.context, load_registry(registry_file))

    def run(self, seeds: list[int]) -> tuple[str, float]:
        """The id of a new sweep, and the seconds until all its machines were built."""
        started = time.monotonic()
        spec = SweepSpec(
            tasks=["support-1"], models=["standin/expert"], seeds=seeds, simulator="mujoco"
        )
        sweep = self._submissions.submit_sweep(spec).sweep
        while self._built(sweep.id) < len(seeds):
            time.sleep(POLL_S)
            assert self.worker.poll() is None, self._log.read_text()[-2000:]
        return sweep.id, time.monotonic() - started

    def _built(self, sweep_id: str) -> int:
        return self.context.store.sweeps.progress(sweep_id).stages.get("simulate queued", 0)


def _measure(service: Service, provider: int, sessions: int, latency_s: float) -> dict[str, object]:
    worker = service.worker.pid
    before = _cpu_s(worker), _cpu_s(provider)
    sweep_id, wall_s = service.run(list(range(sessions)))
    busy_s, provider_s = _cpu_s(worker) - before[0], _cpu_s(provider) - before[1]
    context = service.context
    jobs = context.store.jobs.page(limit=sessions, sweep_id=sweep_id)
    requests = [job.requests for job in jobs]
    starts = [job.started_at for job in jobs if job.started_at is not None]
    turns, ideal_s = sum(requests), max(requests) * latency_s
    waits = [entry.latency_s for job in jobs[:20] for entry in context.store.journal.read(job.id)]
    return {
        "sessions": sessions,
        "latency_s": latency_s,
        "turns": turns,
        "wall_s": round(wall_s, 2),
        "ideal_s": round(ideal_s, 2),
        "all_started_s": round((max(starts) - min(starts)).total_seconds(), 2),
        "share_of_ideal": round(ideal_s / wall_s, 3),
        "cpu_ms_per_turn": round(1000 * busy_s / turns, 2),
        "provider_cpu_ms_per_turn": round(1000 * provider_s / turns, 2),
        "median_latency_s": round(statistics.median(waits), 3),
        "peak_rss_mib": round(_peak_rss(worker) / MEBIBYTE),
        "load_average": round(os.getloadavg()[0], 1),
        "bars": SMALL if sessions < LARGE_FROM else LARGE,
    }


def _peak_rss(pid: int) -> int:
    """The most memory that a process had at once, as the kernel knows it, in bytes."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    (peak,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
    return int(peak) * 1024


def _cpu_s(pid: int) -> float:
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def _backends(
    stack: ExitStack, folder: Path, url: str, sessions: int
) -> tuple[Context, dict[str, str], Path]:
    postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log")
    stack.callback(postgres.stop, postgres.start())
    valkey = EmbeddedValkey(folder / "valkey", folder / "valkey.log")
    stack.callback(valkey.stop, valkey.start())
    registry_file = folder / "models.yaml"
    registry_file.write_text(
        f"providers:\n  standin: {{protocol: openai, base_url: '{url}/v1'}}\n"
        "models:\n  - {name: standin/expert, provider: standin, model: expert}\n"
    )
    settings = Settings(
        database_url=postgres.url, broker_url=valkey.url, data=folder / "data", lease_s=15
    )
    context = open_context(settings)
    stack.callback(context.close)
    context.store.database.migrate()
    environment = {
        **os.environ,
        "BUILDARENA_DATABASE_URL": postgres.url,
        "BUILDARENA_BROKER_URL": valkey.url,
        "BUILDARENA_DATA": str(folder / "data"),
        "BUILDARENA_MODELS_FILE": str(registry_file),
        "BUILDARENA_SESSIONS_PER_WORKER": str(sessions),
    }
    return context, environment, registry_file


if __name__ == "__main__":
    main()
