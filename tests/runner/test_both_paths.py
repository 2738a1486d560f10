"""What a trial comes to does not depend on how its worker reaches the service."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256

import pytest
from sqlalchemy import text
from support.servers.runner_rig import (
    MISSING,
    VERSIONS,
    ended,
    pause_ends,
    runner_key,
    slot,
    submitted,
    true_trajectory,
    two_blocks,
    waiting,
)
from support.stages import work

from buildarena_benchmark import score
from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.runtime.active_lease import LeaseKeeper
from buildarena_pipeline.runtime.job_runner import JobRunner
from buildarena_pipeline.runtime.simulators.simulator import (
    File,
    SimulatorFaultError,
    TrialRequest,
    TrialResult,
)
from buildarena_simulation import write_trajectory
from buildarena_simworker.engines import EngineSimulator
from buildarena_simworker.simulate import simulate_handler

Next = Callable[..., bool]
QUEUE = "simulate.mujoco"


@pytest.fixture(params=["database", "api"])
def do_next(request, context, url) -> Iterator[Next]:
    """Does the next trial with a simulator, by one way or the other; says whether there was one."""
    if request.param == "api":
        _, secret = runner_key(context)

        def by_api(simulator=None) -> bool:
            with slot(url, secret, simulator) as one:
                return one.do_next(0)

        yield by_api
        return
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    keeper.start()

    def by_database(simulator=None) -> bool:
        handler = simulate_handler(context, simulator or EngineSimulator("mujoco"))
        return JobRunner(context.store.leases, handler, keeper, "w").process_next(QUEUE, "any")

    yield by_database
    keeper.stop()


class Played(EngineSimulator):
    """The engine, with something done around a trial."""

    repeatable = False

    def __init__(
        self, around: Callable[[TrialRequest, Callable[[], TrialResult]], TrialResult]
    ) -> None:
        super().__init__("mujoco")
        self._around = around

    def run(self, trial: TrialRequest) -> TrialResult:
        return self._around(trial, lambda: super(Played, self).run(trial))


def raising(error: Exception) -> Played:
    def around(*_: object) -> TrialResult:
        raise error

    return Played(around)


@pytest.mark.ci
def test_a_trial_is_scored_and_kept(context, do_next) -> None:
    job = waiting(context)
    trajectory = true_trajectory(context, job)
    found = score(context.tasks.exact(job.task, job.task_version), two_blocks(), trajectory)
    assert do_next()
    assert not do_next()
    now = ended(context, job)
    digest = sha256(write_trajectory(trajectory)).hexdigest()
    assert (now.success, now.indicator, now.metrics) == (
        found.success,
        found.indicator,
        dict(found.metrics),
    )
    assert now.manifest["simulator"] == VERSIONS
    assert now.manifest["trajectory"] == digest
    assert context.store.jobs.artifacts(job.id)["trajectory-0"] == digest
    (record,) = context.store.rollouts.read(job.id)
    assert record.trajectory_hash == digest
    assert record.trace[0][0] == 0.0
    assert record.wall_s > 0
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]


def test_a_machine_that_is_refused_has_failed(context, do_next) -> None:
    job = waiting(context, MISSING)
    assert do_next()
    now = ended(context, job)
    assert (now.outcome, now.indicator, now.metrics["parts"]) == ("unsuccessful", 0.0, 2)
    (record,) = context.store.rollouts.read(job.id)
    assert (record.trajectory_hash, record.trace) == (None, [])
    assert "which is tracked" in now.manifest["simulator"]["refused"]


def test_a_fault_keeps_its_evidence_and_is_tried_again(context, do_next) -> None:
    job = waiting(context)
    shot = {"screenshot-0-2-0.png": File(data=b"a picture", media_type="image/png")}
    assert do_next(raising(SimulatorFaultError("it hangs", files=shot, delay_s=0.0)))
    now = context.store.jobs.get(job.id)
    assert (now.state, now.faults, now.detail) == ("queued", 1, "it hangs")
    kept = context.store.jobs.artifacts(job.id)["screenshot-0-2-0.png"]
    assert context.artifacts.get(kept) == b"a picture"
    pause_ends(context)
    assert do_next()
    assert ended(context, job).success is not None


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    ("error", "ending"),
    [
        (PermanentError("another game", reason="game_version"), ("done", "game_version", 1)),
        (SimulatorFaultError("a person must come", endless=True), ("queued", None, 1)),
        (RuntimeError("nobody foresaw this"), ("queued", None, 1)),
    ],
)
def test_failures_leave_the_job_where_they_should(context, do_next, error, ending, request) -> None:
    if isinstance(error, PermanentError) and "api" in request.node.callspec.id.split("-"):
        ending = ("queued", None, 1)  # a key alone ends no job
    job = waiting(context)
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE jobs SET faults = 0"))
    assert do_next(raising(error))
    now = context.store.jobs.get(job.id)
    assert (now.state, now.reason, now.faults) == ending
    assert str(error) in now.detail
    assert now.success is None
    assert not do_next()


def test_files_are_kept_by_name(context, do_next) -> None:
    job = waiting(context)
    told = {"log-0.txt": File(data=b"it went well", media_type="text/plain")}

    def around(_: TrialRequest, run: Callable[[], TrialResult]) -> TrialResult:
        done = run()
        return TrialResult(trajectory=done.trajectory, versions=done.versions, files=told)

    assert do_next(Played(around))
    ended(context, job)
    (kept,) = [one for one in context.store.jobs.files(job.id) if one.name == "log-0.txt"]
    assert (context.artifacts.get(kept.hash), kept.media_type) == (b"it went well", "text/plain")


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_cancelled_trial_is_broken_off(context, do_next) -> None:
    job = waiting(context)

    def around(trial: TrialRequest, run: Callable[[], TrialResult]) -> TrialResult:
        context.store.lifecycle.cancel_job(job.id, owner=None, force=True)
        for _ in range(200):
            trial.require_held()
            threading.Event().wait(0.05)
        return run()

    assert do_next(Played(around))
    now = ended(context, job)
    assert (now.outcome, now.success) == ("cancelled", None)
    assert context.store.jobs.attempts(job.id)[-1].result == "cancelled"


def test_who_lost_its_lease_writes_nothing(context, do_next) -> None:
    job = waiting(context)

    def around(_: TrialRequest, run: Callable[[], TrialResult]) -> TrialResult:
        done = run()
        with lease_of_another(context):
            return done

    assert do_next(Played(around))
    now = context.store.jobs.get(job.id)
    assert (now.state, now.success, now.lease_owner) == ("running", None, "another")
    assert [one.result for one in context.store.jobs.attempts(job.id)][-2:] == ["lost", None]


@contextmanager
def lease_of_another(context) -> Iterator[None]:
    """Somebody else has the job from here on, as after a lease that ran out."""
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE leases SET expires_at = now() - interval '1 hour'"))
    context.store.leases.recover()
    assert context.store.leases.claim(QUEUE, owner="another") is not None
    yield


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_driven_car_goes_back_to_its_session_each_time(context, submissions, do_next) -> None:
    job = submitted(context, submissions, task="transport-1")
    for _ in range(3):
        do_next()
        work(context, queues=("construct",))
    assert ended(context, job).outcome == "success"
    records = context.store.rollouts.read(job.id)
    # The expert does not change what works: the same trial is not simulated again.
    assert [record.wall_s > 0 for record in records] == [True, False, False]
