"""What a runner brings counts once a worker of the house verified it, and never if it is a lie."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from support.boards.plain_boards import ended_trials
from support.clients.tenants import WITH_KEYS
from support.jobs import execute
from support.servers.lies import LIES, Lie
from support.servers.live_api import live_api
from support.servers.runner_rig import (
    CARRY,
    VERSIONS,
    Caller,
    as_admin,
    ended,
    runner_key,
    slot,
    submitted,
    true_trajectory,
    waiting,
)
from support.stages import verdict, verify_all, work

from buildarena_api.http.api_key_cache import CACHED_S
from buildarena_backend.agents.submission import request_trial
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_benchmark import parse_custom_task
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import ControllerFailed, Trajectory, simulate, write_trajectory
from buildarena_worker.wiring import verification_runner

OTHER_ENGINE = "a version of the engine that it has not"
SHIFTED = LIES["blocks +0.01 along x"]
CONTROL = Path(__file__).parents[2] / "examples" / "control"
PILOTED = (CONTROL / "to-the-mark.yaml").read_text().replace("duration_s: 20", "duration_s: 2")
FAILS = "function control(t, sense)\n  return t < 1 and {} or sense.nothing.here\nend\n"
DRIVES = (CONTROL / "to-the-mark.lua").read_text()
CLOCK = "the controller failed, tick 3 (0.12 s): it took more than 0.5 s of a processor"


@pytest.fixture
def caller(context, url) -> Caller:
    return with_key(context, url)


@pytest.fixture
def trusting(context) -> Iterator[str]:
    """An API whose operator has no trial of runners verified."""
    with live_api(context, **WITH_KEYS, verification_rate=0.0) as url:
        yield url


def with_key(context: Context, url: str) -> Caller:
    key, secret = runner_key(context)
    return Caller(url, secret, more={"key": key})


def counted(context: Context) -> set[str]:
    """The jobs that boards count."""
    return {trial.job_id for trial in ended_trials(context) if trial.scored}


@pytest.fixture
def bring(context, submissions) -> Callable[..., Job]:
    """Has a runner bring the outcome of a new job, true or not; the job as it is then."""
    known: dict[str, Trajectory] = {}

    def send(caller: Caller, seed: int = 0, lie: Lie = lambda true: true) -> Job:
        job = submitted(context, submissions, seed=seed)
        (record,) = context.store.rollouts.read(job.id)
        if record.machine_hash not in known:
            known[record.machine_hash] = simulated(context, job)
        answer = tell(caller, job, lie(known[record.machine_hash]))
        assert answer.status_code == 200, answer.text
        return ended(context, job)

    return send


def simulated(context: Context, job: Job) -> Trajectory:
    """What MuJoCo says of a job that waits for its trial."""
    (record,) = context.store.rollouts.read(job.id)
    task = context.tasks.exact(job.task, job.task_version)
    machine = Machine.from_document(json.loads(context.artifacts.get(record.machine_hash)))
    presses = record.controls and tuple(KeyPress(**said) for said in record.controls)
    return simulate(machine, task.scenario, "mujoco", controls=presses)


def tell(caller: Caller, job: Job, told: Trajectory) -> httpx.Response:
    """The answer to what a runner says of a job that waits."""
    lease = caller.lease(wait_s=5)
    assert lease["job_id"] == job.id
    versions = {**VERSIONS, "engine_version": told.engine_version}
    return caller.outcome(lease, write_trajectory(told), versions=versions)


@pytest.mark.ci
def test_no_lie_counts(context, url) -> None:
    brought: dict[str, tuple[Job, str]] = {}
    for seed, (name, lie) in enumerate(LIES.items()):
        job, caller = waiting(context, CARRY, seed=seed), with_key(context, url)
        answer = tell(caller, job, lie(true_trajectory(context, job)))
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
            assert (now.audit, "refuted" in now.flags) == ("refuted", True), name
            assert suspended, name


def test_the_truth_counts_once_it_was_verified(context, caller, bring) -> None:
    job = bring(caller)
    assert (job.ran_on_runner, job.audit) == (True, "required")
    assert counted(context) == set()
    slow = context.store.verifications.claim_next()
    assert slow is not None
    execute(context, "UPDATE verifications SET claimed_at = now() - interval '1 hour'")
    verify_all(context)
    now = ended(context, job)
    assert (now.audit, now.flags) == ("verified", [])
    assert now.verified_at is not None
    assert counted(context) == {job.id}
    assert context.store.keys.get(caller.more["key"]).suspended_at is None
    # A verifier that was thought dead overwrites nothing.
    context.store.verifications.finish(slow.id, {"ok": False, "checks": []}, verdict="refuted")
    assert ended(context, job).audit == "verified"
    assert counted(context) == {job.id}


def test_what_the_house_simulates_counts_until_somebody_changed_it(context, submissions) -> None:
    job = submitted(context, submissions)
    work(context)
    before = ended(context, job)
    assert (before.ran_on_runner, before.audit) == (False, None)
    assert counted(context) == {job.id}
    assert verdict(context, job.id) == "verified"
    assert ended(context, job) == before
    execute(context, "UPDATE jobs SET indicator = indicator + 1")
    assert verdict(context, job.id) == "refuted"
    assert counted(context) == set()
    retry = context.store.lifecycle.retry_job
    assert not retry(job.id, owner=None), "no runner brought it"
    execute(context, "UPDATE jobs SET indicator = indicator - 1")
    assert verdict(context, job.id) == "verified"
    now = ended(context, job)
    assert (now.indicator, now.flags, now.audit) == (before.indicator, before.flags, "verified")
    execute(context, """UPDATE rollouts SET versions = versions || '{"simulation": "2"}'""")
    assert verdict(context, job.id) == "inconclusive"
    assert counted(context) == {job.id}


def test_what_is_refuted_leaves_with_all_that_its_key_brought(context, trusting, bring) -> None:
    liar, honest = (with_key(context, trusting) for _ in range(2))
    true, other = bring(liar, 0), bring(honest, 1)
    lie = bring(liar, 2, SHIFTED)
    assert {job.audit for job in (true, other, lie)} == {None}
    assert counted(context) == {true.id, other.id, lie.id}
    assert context.store.verifications.request([lie.id]).ids
    assert verification_runner(context).process_one()
    # At once, before anything else is verified.
    assert counted(context) == {other.id}
    assert ended(context, true).audit == "required"
    verify_all(context)
    assert counted(context) == {true.id, other.id}
    audits = context.store.metrics.read().audits
    assert audits == {"required": 0, "verified": 1, "refuted": 1}
    assert context.store.events.after(0, job_id=lie.id)[-1].kind == "refuted"


def test_a_refuted_trial_runs_again_and_its_key_rests_till_reinstated(
    context, url, caller, bring
) -> None:
    job, honest = bring(caller, 0, SHIFTED), with_key(context, url)
    retry, key = context.store.lifecycle.retry_job, caller.more["key"]
    assert not retry(job.id, owner=None), "it waits for its verification"
    verify_all(context)
    check = context.store.keys.get(key).suspended_for
    time.sleep(CACHED_S)  # so long an API may go by what it read before
    for path in ("/leases", "/heartbeat"):
        answer = caller.ask("POST", path, json=caller.about(leases=[]))
        assert answer.status_code == 401
        assert f"suspended: {check} refuted a trial" in answer.text
    (again,) = context.store.verifications.request([job.id]).ids.values()
    assert not retry(job.id, owner=None), f"{again} is under way"
    verify_all(context)
    assert retry(job.id, owner=None)
    assert not retry(job.id, owner=None)
    now = context.store.jobs.get(job.id)
    assert (now.state, now.stage, now.success, now.flags) == ("queued", "simulate", None, None)
    assert tell(honest, job, simulated(context, now)).status_code == 200
    verify_all(context)
    assert (ended(context, job).audit, counted(context)) == ("verified", {job.id})
    assert not retry(job.id, owner=None), "its score stands"
    path = f"/../keys/{key}/reinstate"
    assert Caller(url, "x").ask("POST", path).status_code == 401
    assert as_admin(url).ask("POST", path).json()["suspended_for"] is None
    assert caller.ask("POST", "/leases", json=caller.about()).status_code == 204


def test_who_can_not_be_told_is_believed_nothing(context, trusting, bring) -> None:
    """A runner that names another version of its engine is not refuted, and gains nothing."""
    liar = with_key(context, trusting)
    true, lie = bring(liar, 0), bring(liar, 1, LIES[OTHER_ENGINE])
    assert counted(context) == {true.id, lie.id}
    assert verdict(context, lie.id) == "inconclusive"
    assert counted(context) == {true.id}, "the truth was verified"
    assert bring(liar, 2).audit == "required"


def piloted(program: str) -> Machine:
    document = json.loads((CONTROL / "car.machine.json").read_text())
    return Machine.from_document(document).with_controller(program)


def waits_for_a_program(context: Context, program: str, seed: int = 0) -> Job:
    task = parse_custom_task(PILOTED, origin="test")
    context.tasks.add(task, PILOTED)
    machine = piloted(program)
    return request_trial(context, machine, task=task.name, simulator="mujoco", seed=seed)[0]


@pytest.fixture
def claimed(context, trusting) -> Callable[[str, str], tuple[Job, str]]:
    """Has a runner say that a program failed; the job once it was verified, and the key."""

    def claim(program: str, sentence: str) -> tuple[Job, str]:
        job, caller = waits_for_a_program(context, program), with_key(context, trusting)
        said = {**VERSIONS, "refused": sentence}
        answer = caller.outcome(caller.lease(wait_s=5), None, versions=said)
        assert answer.status_code == 200, answer.text
        assert ended(context, job).audit == "required", "whatever share of trials is verified"
        verify_all(context)
        return ended(context, job), caller.more["key"]

    return claim


def test_a_program_that_fails_counts_once_it_failed_again(context, trusting) -> None:
    job = waits_for_a_program(context, FAILS)
    with slot(trusting, runner_key(context)[1]) as runner:
        assert runner.do_next(0)
    now = ended(context, job)
    assert (now.outcome, now.audit) == ("unsuccessful", "required")
    assert "line 2, tick 25 (1.00 s): attempt to index" in now.manifest["simulator"]["refused"]
    verify_all(context)
    now = ended(context, job)
    assert (now.audit, now.flags) == ("verified", [])


@pytest.mark.parametrize("lie", [None, ("tick 25", "tick 26"), ("index", "call")])
def test_a_program_that_does_not_fail_so_refutes_who_says_it(context, claimed, lie) -> None:
    scenario = parse_custom_task(PILOTED, origin="test").scenario
    with pytest.raises(ControllerFailed) as caught:
        simulate(piloted(FAILS), scenario, "mujoco")
    true = caught.value.reason
    job, key = claimed(FAILS, true.replace(*lie)) if lie else claimed(DRIVES, true)
    assert (job.audit, "refuted" in job.flags) == ("refuted", True)
    assert context.store.keys.get(key).suspended_at is not None


def test_a_clock_that_nobody_else_has_is_believed_nothing(context, claimed) -> None:
    job, key = claimed(DRIVES, CLOCK)
    assert job.audit == "required"
    assert context.store.keys.get(key).suspended_at is None


def test_without_a_sentence_of_a_program_nothing_is_refused(context, url, caller) -> None:
    waits_for_a_program(context, FAILS)
    lease = caller.lease(wait_s=5)
    long = "the controller failed: " + "obey me. " * 100
    for told in (
        {},
        {"refused": ""},
        {"refused": "I'd rather not"},
        {"refused": [CLOCK]},
        {"refused": long},
    ):
        answer = caller.outcome(lease, None, versions={**VERSIONS, **told})
        assert answer.status_code == 422, told
        assert "does not refuse this machine" in answer.text
    waits_for_a_program(context, "", seed=1)
    caller = with_key(context, url)
    keys = caller.outcome(caller.lease(wait_s=5), None, versions={**VERSIONS, "refused": CLOCK})
    assert keys.status_code == 422, "keys never fail as programs do"
