"""External agents over the tools API."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from support.clients.tenants import new_tenant, operator

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import modules_named
from buildarena_pipeline.agents.briefing import briefing

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
    assert job["track"].startswith("external+data-sheets/mujoco-")
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


def test_a_session_that_is_over_is_not_opened_again(api, session) -> None:
    act(api, session, "start", START)
    api.post(f"/v1/sessions/{session}/submit")
    again = api.post("/v1/sessions", json=OPEN)
    assert again.status_code == 422
    assert again.json()["errors"][0]["field"] == "seed"
    assert api.post("/v1/sessions", json={**OPEN, "seed": 2}).status_code == 201


def test_a_lost_answer_is_asked_for_again(api, context, session) -> None:
    act(api, session, "start", START)
    again = api.post("/v1/sessions", json=OPEN)
    assert (again.status_code, again.json()["id"], again.json()["calls"]) == (200, session, 1)
    assert again.headers["Location"] == f"/v1/jobs/{session}"
    assert act(api, session, "attach_block_to", ATTACH).json()["ok"]
    assert len(context.store.jobs.page(limit=9)) == 1


@pytest.mark.parametrize(
    "change", [{"seed": 2}, {"agent": "other"}, {"task": "support-2"}, {"simulator": "pybullet"}]
)
def test_another_wish_opens_another_session(api, session, change) -> None:
    other = api.post("/v1/sessions", json={**OPEN, **change})
    assert other.status_code == 201
    assert other.json()["id"] != session


def test_sessions_that_are_opened_side_by_side_are_one(api) -> None:
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: api.post("/v1/sessions", json=OPEN), range(8)))
    assert sorted(answer.status_code for answer in answers) == [200] * 7 + [201]
    assert len({answer.json()["id"] for answer in answers}) == 1


def test_nobody_gets_anothers_open_session(guarded) -> None:
    ann, bob, admin = new_tenant(guarded, "A"), new_tenant(guarded, "B"), operator(guarded)

    def opened(who, **change) -> tuple[int, str | None]:
        answer = who.ask("POST", "/v1/sessions", json={**OPEN, **change})
        return answer.status_code, answer.json().get("id")

    status, mine = opened(ann)
    assert status == 201
    # The name is the first key's: nobody else can even ask for its sessions.
    assert opened(bob) == (403, None)
    # An admin may use the name, and gets no session of its owner's by it; nor the other way round.
    assert opened(admin) == (422, None)
    assert opened(admin, seed=2)[0] == 201
    assert opened(ann, seed=2) == (422, None)
    assert opened(ann) == (200, mine)


@pytest.mark.nightly(keep=12)
@pytest.mark.parametrize("task", sorted(builtin_tasks()))
def test_an_agent_is_told_all_it_needs(api, task) -> None:
    # A task whose worlds are drawn is scored in one at least.
    worlds = {"worlds": 1} if builtin_tasks()[task].scenario.draws else {}
    opened = api.post("/v1/sessions", json={**OPEN, "task": task, **worlds}).json()
    text = opened["briefing"]
    assert opened["statement"].strip() in text
    constraints = builtin_tasks()[task].constraints
    offered = {*modules_named(constraints.modules), constraints.catalogue.start.name}
    for module in constraints.catalogue.values():
        shown = f"- {module.name} (" in text and f"mass {module.mass:g}" in text
        assert shown is (module.name in offered), module.name
    for name in offered:
        for action in constraints.catalogue[name].actions:
            assert action in text
    for said in ("x points east, y north, z up", "one trial", "machine `assembly`:", "2,000 calls"):
        assert text.count(said) == 1, said
    assert "$" not in text
    driven = "eys are bound to the actions" in opened["statement"]
    assert ("You write the key presses yourself" in text) is driven
    assert opened["limits"]["calls"] == 2000
    names = {tool["name"] for tool in opened["tools"]}
    assert set(re.findall(r"`([a-z]+(?:_[a-z]+)+)`", text)) - {"machine_id"} <= names


def test_a_task_with_its_own_modules_lists_those_alone() -> None:
    task = builtin_tasks()["lift-3"]
    narrow = task.constraints.model_copy(
        update={"modules": ("Torch",), "min_modules": {"Torch": 3}}
    )
    text = briefing(replace(task, constraints=narrow))
    assert re.findall(r"^- ([A-Z][^(]*) \(.*mass", text, re.MULTILINE) == [
        "Starting Block",
        "Torch",
    ]
    assert "Only the modules listed below. At least 3 x Torch." in text
    assert "exactly 2 sub-structures" in text


@pytest.mark.ci
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


def test_what_a_submission_would_try_can_be_had_and_tried_before(api, session) -> None:
    path = f"/v1/sessions/{session}/machine"
    early = api.get(path)
    assert early.status_code == 409
    assert "there is no machine to simulate" in early.json()["detail"]
    act(api, session, "start", START)
    act(api, session, "attach_block_to", ATTACH)
    document = api.get(path).json()
    assert [block["module"] for block in document["blocks"]] == [
        "Starting Block",
        "Small Wooden Block",
    ]
    tried = api.post("/v1/machines/trials?task=support-1", content=json.dumps(document))
    assert tried.status_code == 202
    assert act(api, session, "attach_block_to", {**ATTACH, "face": "B"}).json()["ok"]


def test_a_program_is_set_and_asked_in_a_session(api) -> None:
    opened = api.post("/v1/sessions", json={**OPEN, "task": "landing-1", "worlds": 1}).json()
    assert "`test_controller` asks what it would do" in opened["briefing"]
    act(api, opened["id"], "start", START)
    fan = {**ATTACH, "face": "E", "new_block": "Flying Block"}
    assert act(api, opened["id"], "attach_block_to", fan).json()["ok"]
    program = "function control(t, sense) return { fly = sense.velocity.z < -1 and 1 or 0 } end"
    assert act(api, opened["id"], "set_controller", {"program": program}).json()["ok"]
    ticks = [{"velocity.z": -0.5}, {"velocity.z": -2}]
    answers = act(api, opened["id"], "test_controller", {"ticks": ticks}).json()["feedback"]
    assert [line.split(" and does ")[1] for line in answers.splitlines()] == [
        "nothing.",
        "2.fly 1.",
    ]
    (main,) = api.get(f"/v1/sessions/{opened['id']}").json()["machines"]
    assert main["controller"] == program
