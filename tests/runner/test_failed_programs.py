"""A runner says that a machine's program failed: believed once it is seen to fail again."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import changed, live_api
from support.servers.runner_rig import VERSIONS, Caller, ended, runner_key, slot

from buildarena_benchmark import parse_custom_task
from buildarena_geometry import Machine
from buildarena_pipeline.agents.machine_trials import request_trial
from buildarena_pipeline.runtime.context import Context
from buildarena_simulation import ControllerFailed, simulate
from buildarena_store import Job
from buildarena_worker.wiring import verification_runner

CONTROL = Path(__file__).parents[2] / "examples" / "control"
TASK = (CONTROL / "to-the-mark.yaml").read_text("utf-8").replace("duration_s: 20", "duration_s: 2")
FAILS = "function control(t, sense)\n  return t < 1 and {} or sense.nothing.here\nend\n"
DRIVES = (CONTROL / "to-the-mark.lua").read_text("utf-8")
CLOCK = "the controller failed, tick 3 (0.12 s): it took more than 0.5 s of a processor"


def piloted(program: str) -> Machine:
    document = json.loads((CONTROL / "car.machine.json").read_text("utf-8"))
    return Machine.from_document(document).with_controller(program)


def failure(program: str) -> str:
    """How a program fails in the trial."""
    task = parse_custom_task(TASK, origin="test")
    with pytest.raises(ControllerFailed) as caught:
        simulate(piloted(program), task.scenario, "mujoco")
    return caught.value.reason


@pytest.fixture
def unchecked(context) -> Iterator[str]:
    """An API whose operator has no trial of runners verified."""
    with changed(context, **WITH_KEYS, audited_share=0.0) as own, live_api(own) as url:
        yield url


def waiting(context: Context, program: str, simulator: str = "mujoco") -> Job:
    task = parse_custom_task(TASK, origin="test")
    context.tasks.add(task, TASK)
    return request_trial(context, piloted(program), task=task.name, simulator=simulator)[0]


def verified(context: Context, job: Job) -> Job:
    """The job after all that must be verified was."""
    runner = verification_runner(context)
    while runner.process_one():
        pass
    return ended(context, job)


@pytest.fixture
def claimed(context, unchecked):
    """Has a runner say that a program failed; the job then, and the runner's key."""

    def claim(program: str, sentence: str) -> tuple[Job, str]:
        job, (key, secret) = waiting(context, program), runner_key(context)
        caller = Caller(unchecked, secret)
        answer = caller.outcome(
            caller.lease(wait_s=5), None, versions={**VERSIONS, "refused": sentence}
        )
        assert answer.status_code == 200, answer.text
        return ended(context, job), key

    return claim


def test_a_program_that_fails_counts_once_it_failed_again(context, unchecked) -> None:
    job, (_, secret) = waiting(context, FAILS), runner_key(context)
    with slot(unchecked, secret) as runner:
        assert runner.do_next(0)
    now = ended(context, job)
    assert (now.outcome, now.audit) == ("unsuccessful", "required")
    assert "line 2, tick 25 (1.00 s): attempt to index" in now.manifest["simulator"]["refused"]
    now = verified(context, job)
    assert (now.audit, now.flags) == ("verified", [])


@pytest.mark.parametrize(
    ("program", "change"),
    [
        (DRIVES, lambda true: true),
        (FAILS, lambda true: true.replace("tick 25", "tick 26")),
        (FAILS, lambda true: true.replace("line 2", "line 1")),
        (FAILS, lambda true: true.replace("index", "call")),
    ],
    ids=["it drives", "another tick", "another line", "another reason"],
)
def test_a_program_that_does_not_fail_so_refutes_who_says_it(
    context, claimed, program, change
) -> None:
    job, key = claimed(program, change(failure(FAILS)))
    assert job.audit == "required", "whatever share of trials is verified"
    now = verified(context, job)
    assert (now.audit, "refuted" in now.flags) == ("refuted", True)
    assert context.store.keys.get(key).suspended_at is not None


def test_a_clock_that_nobody_else_has_is_believed_nothing(context, claimed) -> None:
    job, key = claimed(DRIVES, CLOCK)
    assert verified(context, job).audit == "required"
    assert context.store.keys.get(key).suspended_at is None


@pytest.mark.parametrize(
    "versions",
    [
        {},
        {"refused": ""},
        {"refused": "I would rather not"},
        {"refused": ["the controller failed"]},
        {"refused": "the controller failed: " + "obey me. " * 100},
    ],
)
def test_without_a_sentence_of_a_program_nothing_is_refused(context, url, versions) -> None:
    waiting(context, FAILS)
    caller = Caller(url, runner_key(context)[1])
    answer = caller.outcome(caller.lease(wait_s=5), None, versions={**VERSIONS, **versions})
    assert answer.status_code == 422
    assert "does not refuse this machine" in answer.text


def test_keys_never_fail_as_programs_do(context, url) -> None:
    waiting(context, "")
    caller = Caller(url, runner_key(context)[1])
    answer = caller.outcome(caller.lease(wait_s=5), None, versions={**VERSIONS, "refused": CLOCK})
    assert answer.status_code == 422
