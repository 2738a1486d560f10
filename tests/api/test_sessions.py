"""External agents over the tools API."""

from __future__ import annotations

import json

import pytest

OPEN = {"task": "support-1", "agent": "me", "seed": 1, "simulator": "mujoco"}
START = {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0], "note": ""}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""}


@pytest.fixture
def session(api) -> str:
    answer = api.post("/v1/sessions", json=OPEN)
    assert answer.status_code == 201
    return answer.json()["id"]


def act(api, session: str, tool: str, arguments: object, **more: str):
    body = {"tool": tool, "arguments": arguments, **more}
    return api.post(f"/v1/sessions/{session}/calls", json=body)


def test_an_agent_builds_and_submits(api, context, session) -> None:
    assert act(api, session, "start", START).json()["ok"]
    assert act(api, session, "attach_block_to", ATTACH).json()["ok"]
    refused = act(api, session, "attach_block_to", ATTACH).json()
    assert (refused["ok"], refused["reason"]) == (False, "face_occupied")
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["state"], job["stage"]) == ("queued", "simulate")
    assert (job["actions"], job["refused_actions"]) == (3, 1)
    assert job["refusals"] == {"face_occupied": 1}
    assert job["track"].startswith("external/mujoco-")
    assert api.get(f"/v1/jobs/{session}/machine").status_code == 200
    assert len(api.get(f"/v1/jobs/{session}/transcript").json()["turns"]) == 3
    assert context.queues.settle()
    assert context.queues.waiting("simulate.mujoco") == 1
    page = api.get(f"/v1/jobs/{session}/transcript", params={"style": "markdown"}).text
    assert page.startswith("# support-1 by agent/me, seed 1")
    assert "3 actions, 33.3% of them refused (1 face_occupied)." in page


def test_calls_survive_a_restart_of_the_api(api, context, session) -> None:
    from buildarena_pipeline.agents.sessions import ExternalSessions

    act(api, session, "start", START)
    other = ExternalSessions(context)
    done = other.call(session, machine="main", tool="attach_block_to", arguments=ATTACH)
    assert done.ok
    assert act(api, session, "get_machine_summary", {}).json()["feedback"].count("Wooden") == 1


def test_sub_structures_are_joined_in_the_assembly(api) -> None:
    session = api.post("/v1/sessions", json={**OPEN, "task": "support-2"}).json()["id"]
    for machine in ("left", "right"):
        act(api, session, "start", START, machine=machine)
        act(api, session, "attach_block_to", ATTACH, machine=machine)
    early = api.post(f"/v1/sessions/{session}/submit")
    assert early.status_code == 409
    detail = early.json()["detail"]
    assert "2 machines ('left', 'right') and no assembly" in detail
    assert "put them together in the machine 'assembly'" in detail
    _assemble(api, session)
    joined = {"block_a": "A_1", "face_a": "C", "block_b": "B_1", "face_b": "C"}
    joined |= {"connector": "Brace", "note": ""}
    assert act(api, session, "connect_blocks", joined, machine="assembly").json()["ok"]
    done = api.post(f"/v1/sessions/{session}/submit")
    assert done.status_code == 202
    assert done.json()["stage"] == "simulate"


def _assemble(api, session: str) -> None:
    for machine, shift in (("left", [0, 0, 0]), ("right", [3, 0, 0])):
        arguments = {"machine_id": machine, "init_shift": shift, "init_rotation": [0, 0, 0]}
        done = act(api, session, "add_machine", arguments, machine="assembly").json()
        assert done["ok"], done


@pytest.mark.parametrize(
    ("task", "reason", "says"),
    [
        ("support-1", "constraint_violated", "has 2 sub-structures, the task asks for 1"),
        ("support-2", "unjoined_parts", "sub-structure B is not joined"),
        ("lift-3", "unjoined_parts", "sub-structure B is not joined"),
    ],
)
def test_an_assembly_that_breaks_a_constraint_is_a_scored_failure(api, task, reason, says) -> None:
    session = api.post("/v1/sessions", json={**OPEN, "task": task}).json()["id"]
    for machine in ("left", "right"):
        act(api, session, "start", START, machine=machine)
        act(api, session, "attach_block_to", ATTACH, machine=machine)
    _assemble(api, session)
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["outcome"], job["reason"]) == ("construction_failed", reason)
    assert says in job["detail"]
    assert (job["success"], job["indicator"]) == (False, 0.0)


def test_a_rocket_in_one_piece_is_no_answer_where_two_are_asked_for(api) -> None:
    session = api.post("/v1/sessions", json={**OPEN, "task": "lift-3"}).json()["id"]
    act(api, session, "start", START)
    act(api, session, "attach_block_to", ATTACH)
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["outcome"], job["reason"]) == ("construction_failed", "constraint_violated")
    assert job["detail"] == "the machine has 1 sub-structure, the task asks for 2"


def test_a_block_that_was_shifted_away_is_named(api, session) -> None:
    act(api, session, "start", START)
    act(api, session, "attach_block_to", {**ATTACH, "new_block": "Water Cannon"})
    for _ in range(2):
        moved = {"block_id": "2", "shift_real": [0.5, 0, 0]}
        assert act(api, session, "shift_block", moved).json()["ok"]
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["outcome"], job["reason"]) == ("construction_failed", "unjoined_parts")
    assert job["detail"].startswith("block 2 (Water Cannon) is not joined")


def test_a_session_is_over_once_it_was_submitted(api, session) -> None:
    act(api, session, "start", START)
    act(api, session, "attach_block_to", ATTACH)
    api.post(f"/v1/sessions/{session}/submit")
    late = act(api, session, "reset", {})
    assert late.status_code == 409
    assert "is not open" in late.json()["detail"]
    assert api.post(f"/v1/sessions/{session}/submit").status_code == 409


def test_a_machine_that_breaks_the_rules_is_a_scored_failure(api, session) -> None:
    act(api, session, "start", START)
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["outcome"], job["reason"], job["success"]) == (
        "construction_failed",
        "empty_machine",
        False,
    )


@pytest.mark.usefixtures("session")
def test_each_seed_is_played_once(api) -> None:
    again = api.post("/v1/sessions", json=OPEN)
    assert again.status_code == 422
    assert again.json()["errors"][0]["field"] == "seed"
    assert api.post("/v1/sessions", json={**OPEN, "seed": 2}).status_code == 201


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"task": "x"}, "task"),
        ({"simulator": "x"}, "simulator"),
        ({"agent": "a b"}, "agent"),
        ({"agent": ""}, "agent"),
        ({"seed": -1}, "seed"),
    ],
)
def test_a_bad_wish_names_its_field(api, change, field) -> None:
    problem = api.post("/v1/sessions", json={**OPEN, **change}).json()
    assert problem["errors"][0]["field"] == field


@pytest.mark.parametrize(
    "arguments",
    [None, [], "x", {"base_block": "\0"}, {"note": "\ud800"}, {"a": {"b": [1e308] * 9}}],
)
def test_nonsense_is_refused_and_kept(api, session, arguments) -> None:
    answer = api.post(
        f"/v1/sessions/{session}/calls",
        content=json.dumps({"tool": "attach_block_to", "arguments": arguments}),
        headers={"content-type": "application/json"},
    )
    assert answer.status_code == 200, answer.text
    assert not answer.json()["ok"]


def test_an_unknown_session_is_not_found(api) -> None:
    assert act(api, "job_x", "start", START).status_code == 404
