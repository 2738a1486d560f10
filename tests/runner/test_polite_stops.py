"""Who simulates and is asked to stop finishes the trial, or hands it back in time."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import select
from support.servers.runner_rig import SHORT, runner_key, waiting
from support.servers.stacks import wait_until

from buildarena_store.tables import leases

FEW_BLOCKS = "constraints: {max_blocks: 30}\n"
SECONDS = SHORT.replace("duration_s: 0.4", "duration_s: 240").replace("short", "seconds")
ENDLESS = SHORT.replace("duration_s: 0.4", "duration_s: 600").replace("short", "endless")


@pytest.fixture
def lease_s() -> float:
    """Short enough that trials of seconds see their lease renewed."""
    return 6.0


@contextmanager
def started(words: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    kept = {name: value for name, value in os.environ.items() if "BUILDARENA" not in name}
    words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "mujoco", *words]
    process = subprocess.Popen(words, env=kept | environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture(params=["beside the database", "runner"])
def worker(request, context, settings, lease_s, tmp_path: Path):
    """Starts one that has so long to stop."""

    def start(grace_s: float):
        grace = {"BUILDARENA_STOP_GRACE_S": str(grace_s)}
        if request.param == "runner":
            key = tmp_path / "key"
            key.write_text(runner_key(context)[1] + "\n")
            url = request.getfixturevalue("url")
            return started(["--api", url, "--key-file", str(key)], grace)
        reached = {
            "BUILDARENA_DATABASE_URL": settings.required_database_url(),
            "BUILDARENA_BROKER_URL": settings.required_broker_url(),
            "BUILDARENA_DATA": str(settings.data),
            "BUILDARENA_LEASE_S": str(lease_s),
        }
        return started([], reached | grace)

    return start


def results(context, job_id: str) -> list[str | None]:
    return [attempt.result for attempt in context.store.jobs.attempts(job_id)]


def at_work(context, job_id: str) -> None:
    """Waits until whoever has the job renews its lease."""

    def expires():
        query = select(leases.c.expires_at).where(leases.c.job_id == job_id)
        with context.store.database.statement() as connection:
            return connection.execute(query).scalar_one_or_none()

    first = wait_until(expires, 60, "it is leased")
    wait_until(lambda: expires() != first, 20, "it is worked on")


@pytest.mark.ci
def test_a_trial_under_way_is_finished(context, worker) -> None:
    job = waiting(context, SECONDS + FEW_BLOCKS)
    with worker(120) as process:
        at_work(context, job.id)
        process.send_signal(signal.SIGTERM)
        assert process.wait(100) == 0
    assert results(context, job.id)[-1] == "done"
    assert context.store.rollouts.read(job.id)[0].finished_at is not None


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_trial_that_takes_too_long_is_handed_back(context, worker) -> None:
    job = waiting(context, ENDLESS + FEW_BLOCKS)
    with worker(3) as process:
        at_work(context, job.id)
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    assert results(context, job.id)[-1] == "handed_back"
    now = context.store.jobs.get(job.id)
    assert (now.state, now.faults) == ("queued", 0)
