"""How many sessions one construct process carries: 200 at once against a model that takes 1 s.

Prints medians as JSON. Baseline: the ideal, in which a session takes nothing but its model's
latency.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import psutil

from buildarena_pipeline.context import Context, open_context
from buildarena_pipeline.embedded import EmbeddedPostgres, EmbeddedValkey
from buildarena_pipeline.models import load_registry
from buildarena_pipeline.settings import Settings
from buildarena_pipeline.specs import SweepSpec
from buildarena_pipeline.submission import Submissions
from buildarena_pipeline.sweeper import announce_waiting

SUPPORT = Path(__file__).parents[2] / "support"
STANDIN = """
import sys, time
sys.path.insert(0, sys.argv[1])
from provider_standin import ProviderStandIn
with ProviderStandIn("expert", latency_s=float(sys.argv[2])) as standin:
    print(standin.url, flush=True)
    sys.stdin.read()
"""
MEBIBYTE = 1024 * 1024


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sessions", type=int, default=200)
    parser.add_argument("--latency", type=float, default=1.0)
    given = parser.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.chmod(0o755)
        standin = subprocess.Popen(
            [sys.executable, "-c", STANDIN, str(SUPPORT), str(given.latency)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        stack.callback(standin.wait)
        stack.callback(standin.kill)
        assert standin.stdout is not None
        url = standin.stdout.readline().decode().strip()
        figures = _measure(stack, folder, url, given.sessions, given.latency)
    sys.stdout.write(json.dumps(figures, indent=2) + "\n")


def _measure(
    stack: ExitStack, folder: Path, url: str, sessions: int, latency_s: float
) -> dict[str, object]:
    context, environment, registry_file = _service(stack, folder, url, sessions)
    log = stack.enter_context((folder / "worker.log").open("wb"))
    worker = subprocess.Popen(
        [sys.executable, "-m", "buildarena_worker"], env=environment, stdout=log, stderr=log
    )
    stack.callback(worker.wait)
    stack.callback(worker.terminate)
    process = psutil.Process(worker.pid)
    while not [w for w in context.workers.all() if w.alive]:
        time.sleep(0.1)
    submissions = Submissions(context, load_registry(registry_file))
    busy = _cpu_s(process)
    started = time.monotonic()
    sweep = submissions.submit_sweep(
        SweepSpec(
            tasks=["support-1"], models=["standin/expert"], samples=sessions, simulator="mujoco"
        )
    ).sweep
    peak = 0
    while context.sweeps.progress(sweep.id).stages.get("simulate queued", 0) < sessions:
        announce_waiting(context, "construct")
        peak = max(peak, process.memory_info().rss)
        time.sleep(0.2)
        assert worker.poll() is None, (folder / "worker.log").read_text()[-2000:]
    wall_s = time.monotonic() - started
    busy = _cpu_s(process) - busy
    progress = context.sweeps.progress(sweep.id)
    turns = progress.requests
    longest = max(_turns(context, sweep.id))
    waits = [
        entry.latency_s
        for job in context.jobs.page(limit=5, sweep_id=sweep.id)
        for entry in context.journal.read(job.id)
    ]
    return {
        "sessions": sessions,
        "latency_s": latency_s,
        "turns": turns,
        "wall_s": round(wall_s, 2),
        "ideal_s": round(longest * latency_s, 2),
        "share_of_ideal": round(longest * latency_s / wall_s, 3),
        "cpu_ms_per_turn": round(1000 * busy / turns, 2),
        "median_latency_s": round(statistics.median(waits), 3),
        "peak_rss_mib": round(peak / MEBIBYTE),
        "bars": {"share_of_ideal": ">= 0.9", "cpu_ms_per_turn": "<= 5", "peak_rss_mib": "< 700"},
    }


def _turns(context: Context, sweep_id: str) -> list[int]:
    jobs = context.jobs.page(limit=1000, sweep_id=sweep_id)
    return [job.requests for job in jobs]


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _service(
    stack: ExitStack, folder: Path, url: str, sessions: int
) -> tuple[Context, dict[str, str], Path]:
    postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log")
    stack.callback(postgres.stop, postgres.start())
    valkey = EmbeddedValkey(folder / "valkey", folder / "valkey.log")
    stack.callback(valkey.stop, valkey.start())
    registry_file = folder / "models.yaml"
    registry_file.write_text(
        f"providers:\n  standin: {{wire: openai, base_url: '{url}/v1'}}\n"
        "models:\n  - {name: standin/expert, provider: standin, model: expert}\n"
    )
    settings = Settings(
        database_url=postgres.url, broker_url=valkey.url, data=folder / "data", lease_s=15
    )
    context = open_context(settings)
    stack.callback(context.close)
    context.database.migrate()
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
