"""A construct worker is killed again and again; no reply is paid for twice."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.providers.stand_in import ProviderStandIn
from support.servers.stacks import wait_until

from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.process.reaper import Reaper
from buildarena_backend.submission.submission import Submissions
from buildarena_geometry.machine_files import machine_bytes

KILLS = int(os.environ.get("CHAOS_KILLS", "2"))
LATENCY_S = 0.02
TASK = "support-2" if KILLS > 2 else "support-1"
"""A session of some two hundred turns has time for many kills, one of fifty for two."""


@contextmanager
def worker(environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    log = Path(environment["BUILDARENA_DATA"]) / "worker.log"
    log.parent.mkdir(exist_ok=True)
    with log.open("ab") as stream:
        process = subprocess.Popen(
            [sys.executable, "-m", "buildarena_worker"],
            env=environment,
            stdout=stream,
            stderr=subprocess.STDOUT,
        )
    try:
        yield process
    except AssertionError as error:
        rendered = "\n".join(log.read_text().splitlines()[-20:])
        raise AssertionError(f"{error}; exit code {process.poll()}; log:\n{rendered}") from error
    finally:
        process.kill()
        process.wait()


@pytest.mark.ci
def test_a_session_that_is_killed_again_and_again_builds_the_same_machine(
    play, context, settings, tmp_path
) -> None:
    undisturbed = play("builtin/expert", task=TASK)
    rng = random.Random(os.environ.get("CHAOS_SEED", "1"))
    with ProviderStandIn("expert", latency_s=LATENCY_S) as standin:
        file = tmp_path / "models.yaml"
        file.write_text(
            f"providers:\n  standin: {{protocol: openai, base_url: '{standin.url}/v1'}}\n"
            "models:\n  - {name: standin/expert, provider: standin, model: expert}\n"
        )
        job, _ = Submissions(context, load_registry(file)).submit_job(
            JobSpec(task=TASK, model="standin/expert", simulator="mujoco")
        )
        environment = {
            **os.environ,
            "BUILDARENA_DATABASE_URL": settings.required_database_url(),
            "BUILDARENA_BROKER_URL": settings.required_broker_url(),
            "BUILDARENA_DATA": str(settings.data),
            "BUILDARENA_MODELS_FILE": str(file),
            "BUILDARENA_LEASE_S": "2",
            "BUILDARENA_SESSIONS_PER_WORKER": "1",
            "BUILDARENA_MAX_FAULTS": "1000",
        }
        kills = 0
        while kills < KILLS:
            with worker(environment) as process:
                seen = standin.counts.requests
                wait_until(lambda seen=seen: standin.counts.requests > seen, 120, "a request")
                time.sleep(rng.uniform(0, 12 * LATENCY_S))
                if context.store.jobs.get(job.id).stage != "construct":
                    break
                os.kill(process.pid, signal.SIGKILL)
                kills += 1
        with worker(environment):
            reaper = Reaper(context)

            def built() -> bool:
                reaper.reap()
                return context.store.jobs.get(job.id).stage == "simulate"

            wait_until(built, 120, "the machine is built")
        extra = standin.counts.requests - len(undisturbed.entries)
    assert kills > 0
    assert 0 <= extra <= kills
    journal = context.store.journal.read(job.id)
    assert [entry.reply["text"] for entry in journal] == [
        entry.reply["text"] for entry in undisturbed.entries
    ]
    assert sum(entry.usage.requests for entry in journal) == context.store.jobs.get(job.id).requests
    (rollout,) = context.store.rollouts.read(job.id)
    machine = machine_bytes(undisturbed.suspended.machine)
    assert context.artifacts.get(rollout.machine_hash) == machine
    sys.stdout.write(f"{kills} kills, {extra} requests more than undisturbed\n")
