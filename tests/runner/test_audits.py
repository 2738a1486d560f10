"""What a runner brings counts once a worker of the house verified it, and never if it is a lie."""

import json
import time
from collections.abc import Callable, Iterator

import httpx
import pytest
from sqlalchemy import text
from support.clients.tenants import WITH_KEYS
from support.servers.lies import LIES, Lie
from support.servers.live_api import changed, live_api
from support.servers.runner_rig import (
    CARRY,
    VERSIONS,
    Caller,
    as_admin,
    ended,
    runner_key,
    submitted,
    true_trajectory,
    waiting,
)
from support.stages import work

from buildarena_api.http.key_checks import CACHED_S
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.runtime.context import Context
from buildarena_simulation import Trajectory, simulate, write_trajectory
from buildarena_store import Job, TrialFilter
from buildarena_worker.wiring import verification_runner

OTHER_ENGINE = "a version of the engine that it has not"
SHIFTED = LIES["blocks +0.01 along x"]


@pytest.fixture
def caller(context, url) -> Caller:
    return with_key(context, url)


def with_key(context: Context, url: str) -> Caller:
    key, secret = runner_key(context)
    return Caller(url, secret, more={"key": key})


def verify_all(context: Context) -> None:
    runner = verification_runner(context)
    while runner.process_one():
        pass


def verify(context: Context, job: Job) -> str | None:
    """Has a job verified, whether it must be or not; what came of it."""
    (check,) = context.store.verifications.request([job.id]).ids.values()
    verify_all(context)
    return context.store.verifications.get(check).verdict


def counted(context: Context) -> set[str]:
    """The jobs that boards count."""
    trials = context.store.results.boards.trials(TrialFilter())
    return {trial.job_id for trial in trials if trial.scored}


def changes(context: Context, job: Job) -> list[tuple[str, str]]:
    """What the log of boards says of a job: kinds with their reasons."""
    log = context.store.results.boards.changes(job.track, scored_only=False)
    found = [(change.kind, change.why or "") for change in log if change.job_id == job.id]
    return found[::-1]


def simulated(context: Context, job: Job) -> Trajectory:
    """What MuJoCo says of a job that waits for its trial."""
    (record,) = context.store.rollouts.read(job.id)
    task = context.tasks.exact(job.task, job.task_version)
    assert task is not None
    machine = Machine.from_document(json.loads(context.artifacts.get(record.machine_hash)))
    presses = record.controls and tuple(KeyPress(**said) for said in record.controls)
    return simulate(machine, task.scenario, "mujoco", controls=presses)


@pytest.fixture
def bring(context, submissions) -> Callable[..., Job]:
    """Has a runner bring the outcome of a new job, true or not; the job as it is then."""
    trajectories: dict[str, Trajectory] = {}

    def send(caller: Caller, seed: int, lie: Lie = lambda true: true) -> Job:
        job = submitted(context, submissions, seed=seed)
        lease = caller.lease(wait_s=5)
        assert lease["job_id"] == job.id
        (record,) = context.store.rollouts.read(job.id)
        if record.machine_hash not in trajectories:
            trajectories[record.machine_hash] = simulated(context, job)
        told = lie(trajectories[record.machine_hash])
        versions = {**VERSIONS, "engine_version": told.engine_version}
        answer = caller.outcome(lease, write_trajectory(told), versions=versions)
        assert answer.status_code == 200, answer.text
        return ended(context, job)

    return send


@pytest.fixture
def trusting(context) -> Iterator[str]:
    """An API whose operator has no trial of runners verified."""
    with changed(context, **WITH_KEYS, audited_share=0.0) as own, live_api(own) as url:
        yield url


@pytest.mark.ci
def test_no_lie_counts(context, url) -> None:
    assert len(LIES) >= 50
    brought: dict[str, tuple[Job, str]] = {}
    true: Trajectory | None = None
    for seed, (name, lie) in enumerate(LIES.items()):
        job = waiting(context, CARRY, seed=seed)
        true = true or true_trajectory(context, job)
        caller = with_key(context, url)
        lease = caller.lease(wait_s=5)
        told = lie(true)
        versions = {**VERSIONS, "engine_version": told.engine_version}
        answer = caller.outcome(lease, write_trajectory(told), versions=versions)
        if answer.status_code == 200:
            brought[name] = ended(context, job), caller.more["key"]
        else:
            # It is known for a lie at once: the job waits for somebody honest.
            assert answer.status_code == 422, (name, answer.text)
            context.store.lifecycle.cancel_job(job.id, owner=None, force=True)
    assert len(brought) > len(LIES) / 2, "most are seen only when they are simulated again"
    verify_all(context)
    for name, (job, key) in brought.items():
        now, suspended = ended(context, job), context.store.keys.get(key).suspended_for
        if name == OTHER_ENGINE:
            # Nobody can say; so it does not count.
            assert (now.audit, suspended) == ("required", None)
        else:
            assert now.audit == "refuted", name
            assert "refuted" in now.flags, name
            assert suspended, name


def test_the_truth_counts_once_it_was_verified(context, caller, bring) -> None:
    job = bring(caller, 0)
    assert (job.by_runner, job.audit, job.success) == (True, "required", True)
    assert counted(context) == set()
    verify_all(context)
    now = ended(context, job)
    assert (now.audit, now.flags) == ("verified", [])
    assert now.verified_at is not None
    assert counted(context) == {job.id}
    assert [kind for kind, _ in changes(context, job)] == ["unscored", "entered"]
    assert context.store.keys.get(caller.more["key"]).suspended_at is None


def test_what_the_house_simulates_counts_at_once(context, submissions) -> None:
    job = submitted(context, submissions)
    work(context)
    now = ended(context, job)
    assert (now.by_runner, now.audit) == (False, None)
    assert counted(context) == {job.id}
    assert verify(context, job) == "verified"
    # What needed no verification is not changed by one.
    assert ended(context, job) == now


@pytest.mark.ci
def test_what_is_refuted_leaves_with_all_that_its_key_brought(context, trusting, bring) -> None:
    liar, honest = (with_key(context, trusting) for _ in range(2))
    true, other = bring(liar, 0), bring(honest, 1)
    lie = bring(liar, 2, SHIFTED)
    assert {job.audit for job in (true, other, lie)} == {None}
    assert counted(context) == {true.id, other.id, lie.id}
    (check,) = context.store.verifications.request([lie.id]).ids.values()
    runner = verification_runner(context)
    assert runner.process_one()
    # At once, before anything else is verified.
    assert counted(context) == {other.id}
    assert changes(context, lie)[-1] == ("left", f"refuted by {check}")
    assert changes(context, true)[-1] == ("left", f"its runner was refuted by {check}")
    assert ended(context, true).audit == "required"
    verify_all(context)
    assert counted(context) == {true.id, other.id}
    metrics = context.store.metrics.read()
    assert metrics.audits == {"required": 0, "verified": 1, "refuted": 1}
    assert metrics.verifications == {"verified": 1, "refuted": 1, "inconclusive": 0}
    assert context.store.events.after(0, job_id=lie.id)[-1].kind == "refuted"


@pytest.mark.ci
def test_a_suspended_key_may_do_nothing_until_it_is_reinstated(context, url, caller, bring) -> None:
    lie = bring(caller, 0, SHIFTED)
    key = caller.more["key"]
    verify_all(context)
    check = context.store.keys.get(key).suspended_for
    time.sleep(CACHED_S)  # so long an API may go by what it read before
    for method, path, more in (
        ("POST", "/leases", {"json": caller.about()}),
        ("POST", "/heartbeat", {"json": caller.about(leases=[])}),
        ("GET", "", {}),
    ):
        answer = caller.ask(method, path, **more)
        assert answer.status_code == 401
        assert f"suspended: {check} refuted a trial" in answer.text
    admin = {"Authorization": f"Bearer {as_admin(url).secret}"}
    thief = httpx.post(f"{url}/v1/keys/{key}/reinstate", headers={"Authorization": "Bearer x"})
    assert thief.status_code == 401
    answer = httpx.post(f"{url}/v1/keys/{key}/reinstate", headers=admin)
    assert (answer.status_code, answer.json()["suspended_for"]) == (200, None)
    assert caller.ask("POST", "/leases", json=caller.about()).status_code == 204
    assert ended(context, lie).audit == "refuted"


@pytest.mark.ci
def test_a_refuted_trial_is_run_again_and_nothing_is_built_twice(context, url, bring) -> None:
    liar, honest = (with_key(context, url) for _ in range(2))
    job = bring(liar, 0, SHIFTED)
    retry = context.store.lifecycle.retry_job
    assert not retry(job.id, owner=None), "it waits for its verification"
    verify_all(context)
    journal = context.store.journal.read(job.id)
    (check,) = context.store.verifications.request([job.id]).ids.values()
    assert not retry(job.id, owner=None), f"{check} is under way"
    verify_all(context)
    assert retry(job.id, owner=None)
    assert not retry(job.id, owner=None)
    now = context.store.jobs.get(job.id)
    assert (now.state, now.stage, now.success, now.flags) == ("queued", "simulate", None, None)
    lease = honest.lease(wait_s=5)
    answer = honest.outcome(lease, write_trajectory(simulated(context, now)))
    assert answer.status_code == 200, answer.text
    verify_all(context)
    now = ended(context, job)
    assert (now.audit, now.success, now.flags) == ("verified", True, [])
    assert counted(context) == {job.id}
    assert context.store.journal.read(job.id) == journal
    assert context.store.keys.get(liar.more["key"]).suspended_for
    assert not retry(job.id, owner=None), "its score stands"


def test_a_refuted_score_that_no_runner_brought_is_not_run_again(context, submissions) -> None:
    job = submitted(context, submissions)
    work(context)
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE jobs SET indicator = indicator + 1"))
    assert verify(context, job) == "refuted"
    assert not context.store.lifecycle.retry_job(job.id, owner=None)


def test_who_can_not_be_told_is_believed_nothing(context, trusting, bring) -> None:
    """A runner that names another version of its engine is not refuted, and gains nothing."""
    liar = with_key(context, trusting)
    true, lie = bring(liar, 0), bring(liar, 1, LIES[OTHER_ENGINE])
    assert counted(context) == {true.id, lie.id}
    (check,) = context.store.verifications.request([lie.id]).ids.values()
    verify_all(context)
    assert context.store.verifications.get(check).verdict == "inconclusive"
    assert counted(context) == {true.id}, "the truth was verified"
    later = bring(liar, 2)
    assert later.audit == "required"


def test_a_score_that_somebody_changed_is_refuted_until_it_is_as_it_was(
    context, submissions
) -> None:
    job = submitted(context, submissions)
    work(context)
    before = ended(context, job)
    for change, verdict, counts in (
        ("indicator = indicator + 1", "refuted", set()),
        ("indicator = indicator - 1", "verified", {job.id}),
    ):
        with context.store.database.transaction() as connection:
            connection.execute(text(f"UPDATE jobs SET {change}"))
        assert verify(context, job) == verdict
        assert counted(context) == counts
    now = ended(context, job)
    assert (now.indicator, now.flags, now.audit) == (before.indicator, before.flags, "verified")


def test_what_is_damaged_or_of_another_version_is_not_refuted(context, submissions) -> None:
    job = submitted(context, submissions)
    work(context)
    with context.store.database.transaction() as connection:
        connection.execute(
            text('UPDATE rollouts SET versions = versions || \'{"simulation": "2"}\'')
        )
    assert verify(context, job) == "inconclusive"
    assert counted(context) == {job.id}


def test_a_verification_that_ends_twice_counts_once(context, caller, bring) -> None:
    job = bring(caller, 0)
    slow = context.store.verifications.claim_next()
    assert slow is not None
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE verifications SET claimed_at = now() - interval '1 hour'"))
    verify_all(context)
    assert ended(context, job).audit == "verified"
    context.store.verifications.finish(slow.id, {"ok": False, "checks": []}, verdict="refuted")
    assert ended(context, job).audit == "verified"
    assert counted(context) == {job.id}
