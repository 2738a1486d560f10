"""Test trials of external agents and people: a session's machine is tried, and it goes on."""

import json

import pytest
from sqlalchemy import text
from support.stages import verdict, work

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.families.hidden_parameters import sample_hidden_parameters
from buildarena_benchmark.tasks.design.expert import riser

TASK = builtin_tasks()["identify-1"]
DRAW = 7_654_321_987_654
OPEN = {"task": TASK.name, "worlds": 0}


def build(act, session: str):
    design = riser(1)
    for tool, arguments in design.parts["riser"].actions:
        act(session, tool, dict(arguments))
    for bound in design.steer([])["control_config"]:
        for key in bound["keys"]:
            told = {"block_id": bound["block"], "action": bound["action"], "new_key": key}
            act(session, "change_control_key", told)
    return design


def programmed(act, session: str, program) -> None:
    act(session, "reset_control_sequence", {})
    for press in program["control_sequence"]:
        act(session, "add_control_sequence", press)


@pytest.mark.ci
def test_a_session_has_the_test_trials_that_its_task_says(api, open_session, act, context) -> None:
    session = open_session(**OPEN)
    programmed(act, session, build(act, session).steer([]))
    for number in range(1, TASK.test_trials + 1):
        assert api.post(f"/v1/sessions/{session}/test-trials").status_code == 200
        early = api.post(f"/v1/sessions/{session}/submit")
        assert (early.status_code, "is being tried" in early.json()["detail"]) == (409, True)
        work(context)
        view = api.get(f"/v1/sessions/{session}").json()
        assert (len(view["test_trials"]), view["max_test_trials"]) == (number, TASK.test_trials)
        assert view["test_trials"][-1]["trace"]
    more = api.post(f"/v1/sessions/{session}/test-trials")
    told = "all 3 test trials are used up: submit"
    assert (more.status_code, more.json()["detail"]) == (409, told)


@pytest.mark.ci
def test_no_answer_of_an_open_session_tells_the_draw(api, open_session, act, context) -> None:
    session = open_session(**OPEN)
    # A draw whose figures are no part of others that an answer may well have.
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE jobs SET randomization_seed = :draw"), {"draw": DRAW})
    design = build(act, session)
    programmed(act, session, design.steer([]))
    api.post(f"/v1/sessions/{session}/test-trials")
    work(context)
    job = context.store.jobs.get(session)
    assert job.randomization_seed == DRAW
    hidden = sample_hidden_parameters(TASK.hidden_parameters, job.randomization_seed)
    drawn = [str(number) for number in hidden.values()]
    secrets = [*drawn, str(job.randomization_seed)]
    for path in (
        f"/v1/sessions/{session}",
        f"/v1/jobs/{session}",
        "/v1/jobs",
        f"/v1/jobs/{session}/transcript",
        f"/v1/jobs/{session}/replay",
        f"/v1/jobs/{session}/scene",
        f"/v1/jobs/{session}/machine",
        f"/v1/tasks/{TASK.name}",
        "/v1/tasks",
    ):
        answer = api.get(path)
        assert answer.status_code == 200, (path, answer.text)
        for secret in secrets:
            assert secret not in answer.text, (path, secret)
    for path in (f"/v1/jobs/{session}/trajectory", f"/v1/jobs/{session}/artifacts/trajectory-0"):
        answer = api.get(path)
        assert answer.status_code == 404, path
        assert "once it has ended" in answer.json()["detail"]
    api.post(f"/v1/sessions/{session}/submit")
    work(context)
    assert api.get(f"/v1/jobs/{session}/trajectory").status_code == 200


@pytest.mark.ci
def test_who_breaks_a_rule_after_a_test_trial_has_failed(api, open_session, act, context) -> None:
    session = open_session(**OPEN)
    programmed(act, session, build(act, session).steer([]))
    assert api.post(f"/v1/sessions/{session}/test-trials").status_code == 200
    work(context)
    act(session, "start", {}, machine="other")
    for name, east in (("main", 0), ("other", 40)):
        copied = {"machine_id": name, "init_shift": [east, 0, 0], "init_rotation": [0, 0, 0]}
        act(session, "add_machine", copied, machine="assembly")
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["outcome"], job["indicator"]) == ("construction_failed", 0.0), job
    assert verdict(context, session) == "verified"


def test_what_is_no_trial_uses_up_no_test_trial(api, open_session, act) -> None:
    session = open_session(**OPEN)
    for name in ("test_trial", "Test_Trial"):
        answer = api.post(f"/v1/sessions/{session}/calls", json={"tool": name, "arguments": {}})
        assert answer.status_code == 409
    assert api.post(f"/v1/sessions/{session}/test-trials").status_code == 409
    act(session, "start", {})
    answer = api.post(f"/v1/sessions/{session}/test-trials")
    assert (answer.status_code, "would not be tried" in answer.json()["detail"]) == (409, True)
    view = api.get(f"/v1/sessions/{session}").json()
    assert (view["test_trials"], view["open"], view["calls"]) == ([], True, 1)


def test_the_last_trial_and_machines_from_files_have_worlds(
    api, open_session, act, context
) -> None:
    """The exact world is for the trial that counts, and for the other test trials."""
    session = open_session(task="lift-1", worlds=0, simulator="mujoco")
    act(session, "start", {})
    cannon = {"base_block": "1", "face": "A", "new_block": "Water Cannon"}
    act(session, "attach_block_to", cannon)
    for _ in range(3):
        assert api.post(f"/v1/sessions/{session}/test-trials").status_code == 200
        work(context)
    api.post(f"/v1/sessions/{session}/submit")
    work(context)
    records = context.store.rollouts.read(session)
    assert [record.seed is None for record in records] == [True, True, False, True]
    shown = api.get(f"/v1/jobs/{session}").json()
    assert (shown["test_trials"], [world["rollout"] for world in shown["worlds"]]) == (3, [3])
    # A trial that was not simulated again is shown like the one that it repeats.
    assert shown["artifacts"]["trajectory-3"] == shown["artifacts"]["trajectory-0"]
    assert verdict(context, session) == "verified"
    document = json.dumps(api.get(f"/v1/jobs/{session}/machine").json()).encode()
    asked = {"task": "lift-1", "simulator": "mujoco", "seed": 7}
    job = api.post("/v1/machines/trials", params=asked, content=document).json()["id"]
    work(context)
    assert [record.seed for record in context.store.rollouts.read(job)] == [7]
    assert api.get(f"/v1/jobs/{job}").json()["outcome"] is not None
    assert verdict(context, job) == "verified"


@pytest.mark.ci
def test_machines_from_files_have_their_own_world_each_time(
    api, open_session, act, context
) -> None:
    """So that a file is no further test trial of anybody's session."""
    session = open_session(**OPEN)
    design = build(act, session)
    programmed(act, session, design.steer([]))
    api.post(f"/v1/sessions/{session}/submit")
    document = json.dumps(api.get(f"/v1/jobs/{session}/machine").json()).encode()
    asked = {"task": TASK.name, "simulator": "mujoco", "seed": 1}
    tried = api.post("/v1/machines/trials", params=asked, content=document)
    work(context)
    first, second = (api.get(f"/v1/jobs/{i}").json() for i in (session, tried.json()["id"]))
    assert first["manifest"]["drawn"] != second["manifest"]["drawn"]
