"""Does what waits, with the real stage handlers, in the test's process."""

import json
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from sqlalchemy import text
from support.paid_models import REGISTRY

from buildarena_backend.process.active_lease import LeaseKeeper
from buildarena_backend.process.context import Context
from buildarena_backend.process.job_runner import JobRunner
from buildarena_backend.states import simulate_queue
from buildarena_backend.trials.installed_simulators import installed_simulators
from buildarena_backend.trials.simulator import Simulator
from buildarena_backend.trials.trials import TrialRequest, TrialResult
from buildarena_simworker.simulate import SimulateHandler
from buildarena_worker.wiring import construct_handler, verification_runner, verifier

_TRIALS: dict[str, TrialResult] = {}


class Remembering:
    """A simulator that simulates the same trial once: its bytes are the same each time.

    Args:
        simulator: The engine.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self.versions: Mapping[str, Any] = simulator.versions

    def run(self, trial: TrialRequest) -> TrialResult:
        trial.require_held()
        scenario = trial.task.scenario.model_dump(mode="json")
        presses = [str(press) for press in trial.controls or ()]
        told = [self.versions, trial.machine.to_document(), scenario, presses]
        asked = json.dumps([*told, trial.controls is None, trial.seed], sort_keys=True)
        if asked not in _TRIALS:
            _TRIALS[asked] = self._simulator.run(trial)
        return _TRIALS[asked]

    def close(self) -> None:
        self._simulator.close()


def work(
    context: Context,
    *,
    steps: int = 1000,
    threads: int = 1,
    queues: tuple[str, ...] | None = None,
) -> None:
    """Works until nothing waits.

    Args:
        context: Where the jobs are.
        steps: Stages at most.
        threads: Stages at once.
        queues: Only jobs of these queues; others are left to their own workers.
    """
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    keeper.start()
    engines = [one for one in installed_simulators().values() if one.kind == "engine"]
    made = {simulate_queue(one.name): Remembering(one.make(context.settings)) for one in engines}
    handlers = {queue: SimulateHandler(context, engine) for queue, engine in made.items()}
    handlers["construct"] = construct_handler(context, REGISTRY)
    leases = context.store.leases
    runners = {queue: JobRunner(leases, made, keeper, "w") for queue, made in handlers.items()}
    with ThreadPoolExecutor(threads) as pool:
        while steps > 0:
            queued = context.store.jobs.page(limit=100, state="queued")
            waiting = [job for job in queued if queues is None or job.queue in queues]
            if not waiting:
                break
            waiting = waiting[:steps]
            steps -= len(waiting)
            list(pool.map(lambda job: runners[job.queue].process_next(job.queue), waiting))
    keeper.stop()


def assert_verified(context: Context, job_id: str) -> None:
    """Every figure of the job is the same when its session is played and scored again."""
    report = verifier(context).verify(job_id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


def verify_all(context: Context) -> None:
    """Does all verifications that wait."""
    runner = verification_runner(context)
    while runner.process_one():
        pass


def verdict(context: Context, job_id: str) -> str | None:
    """What a worker's verification of the job comes to."""
    (check,) = context.store.verifications.request([job_id]).ids.values()
    verify_all(context)
    return context.store.verifications.get(check).verdict


_RESTORED = """
UPDATE jobs SET success = kept.success, indicator = kept.indicator,
    input_tokens = kept.input_tokens, metrics = kept.metrics
FROM kept_jobs AS kept WHERE kept.id = jobs.id;
DELETE FROM rollouts; INSERT INTO rollouts SELECT * FROM kept_rollouts;
DELETE FROM journal; INSERT INTO journal SELECT * FROM kept_journal;
DROP TABLE kept_jobs, kept_rollouts, kept_journal
"""


@contextmanager
def tampered(context: Context, statement: str, **values: str) -> Iterator[None]:
    """Changes figures of jobs, rollouts or journals, and has them as they were in the end."""
    with context.store.database.transaction() as connection:
        for table in ("jobs", "rollouts", "journal"):
            connection.exec_driver_sql(f"CREATE TABLE kept_{table} AS SELECT * FROM {table}")
        connection.execute(text(statement), values)
    yield
    with context.store.database.transaction() as connection:
        for restoring in _RESTORED.split(";"):
            connection.exec_driver_sql(restoring)
