"""Agents and people who build over the tools API."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from support.clients.tenants import new_tenant, operator

from buildarena_backend.agents.briefing import briefing
from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine, modules_named

OPEN = {"task": "support-1", "agent": "me", "seed": 1, "simulator": "mujoco"}
START = {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0], "note": ""}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""}


@pytest.fixture
def session(open_session) -> str:
    return open_session()


def test_an_agent_builds_and_submits(api, context, session, act) -> None:
    assert act(session, "start", START)["ok"]
    # Calls survive a restart of the API.
    other = ExternalSessions(context)
    assert other.call(session, machine="main", tool="attach_block_to", arguments=ATTACH).ok
    refused = act(session, "attach_block_to", ATTACH)
    assert (refused["ok"], refused["reason"]) == (False, "face_occupied")
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["state"], job["stage"], job["model"]) == ("queued", "simulate", "agent/me")
    assert (job["actions"], job["refused_actions"]) == (3, 1)
    assert job["refusals"] == {"face_occupied": 1}
    assert job["track"].startswith("external+data-sheets/mujoco-")
    assert api.get(f"/v1/jobs/{session}/machine").status_code == 200
    assert len(api.get(f"/v1/jobs/{session}/transcript").json()["turns"]) == 3
    context.queues.settle()
    assert context.queues.waiting("simulate.mujoco") == 1
    page = api.get(f"/v1/jobs/{session}/transcript", params={"format": "markdown"}).text
    assert page.startswith("# support-1 by agent/me, seed 1")
    assert "3 actions, 33.3% of them refused (1 face_occupied)." in page
    late = api.post(f"/v1/sessions/{session}/calls", json={"tool": "reset", "arguments": {}})
    assert (late.status_code, "is not open" in late.json()["detail"]) == (409, True)
    assert api.post(f"/v1/sessions/{session}/submit").status_code == 409
    again = api.post("/v1/sessions", json=OPEN)
    assert (again.status_code, again.json()["errors"][0]["field"]) == (422, "seed")


def test_a_machine_that_breaks_the_rules_is_a_scored_failure(api, session, act) -> None:
    act(session, "start", START)
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert (job["outcome"], job["reason"]) == ("construction_failed", "empty_machine")
    assert (job["success"], job["indicator"]) == (False, 0.0)


@pytest.mark.parametrize(
    "case",
    [
        ("support-1", 2, "constraint_violated", "has 2 sub-structures, the task asks for 1"),
        ("lift-3", 2, "unjoined_parts", "sub-structure B is not joined"),
        ("lift-3", 1, "constraint_violated", "has 1 sub-structure, the task asks for 2"),
        ("support-2", 2, None, None),
    ],
)
def test_sub_structures_are_joined_in_the_assembly_as_asked(api, open_session, act, case) -> None:
    task, machines, reason, says = case
    session = open_session(task=task)
    names = ("left", "right") if machines == 2 else ("main",)
    for machine in names:
        act(session, "start", START, machine)
        act(session, "attach_block_to", ATTACH, machine)
    if machines == 2:
        early = api.post(f"/v1/sessions/{session}/submit")
        assert early.status_code == 409
        assert "2 machines ('left', 'right') and no assembly" in early.json()["detail"]
        for machine, east in zip(names, (0, 3), strict=True):
            given = {"machine_id": machine, "init_shift": [east, 0, 0], "init_rotation": [0, 0, 0]}
            assert act(session, "add_machine", given, "assembly")["ok"]
    if reason is None:
        joined = {"block_a": "A_1", "face_a": "C", "block_b": "B_1", "face_b": "C"}
        joined |= {"connector": "Brace", "note": ""}
        assert act(session, "connect_blocks", joined, "assembly")["ok"]
    done = api.post(f"/v1/sessions/{session}/submit").json()
    assert done["reason"] == reason
    assert says in done["detail"] if says else done["stage"] == "simulate"


def test_an_equal_wish_is_the_same_session(api, context, session, act, open_session) -> None:
    """As of somebody whose answer was lost."""
    act(session, "start", START)
    again = api.post("/v1/sessions", json=OPEN)
    assert (again.status_code, again.json()["id"], again.json()["calls"]) == (200, session, 1)
    assert again.headers["Location"] == f"/v1/sessions/{session}"
    assert len(context.store.jobs.page(limit=9)) == 1
    changes = ({"seed": 2}, {"agent": "x"}, {"task": "support-2"}, {"simulator": "pybullet"})
    assert len({session, *(open_session(**change) for change in changes)}) == 5
    with ThreadPoolExecutor(8) as pool:
        wish = {**OPEN, "seed": 7}
        answers = list(pool.map(lambda _: api.post("/v1/sessions", json=wish), range(8)))
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
    # Nobody shares a name between people and agents, not even an admin.
    assert opened(admin, seed=3, kind="human") == opened(ann, seed=3, kind="human") == (403, None)


def test_names_are_of_people_or_agents_and_well_formed(api, open_session, act) -> None:
    session = open_session(agent="ada", kind="human")
    act(session, "start", {})
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert job["model"] == "human/ada"
    assert job["track"].startswith("external+data-sheets/mujoco-")
    refused = api.post("/v1/sessions", json={**OPEN, "agent": "ada", "seed": 2})
    assert refused.status_code == 403
    assert "choose another name" in refused.json()["detail"]
    for field, bad in (
        *(("agent", name) for name in ("a b", "agent/x", "", "x" * 81)),
        *(("kind", "robot"), ("seed", -1)),
    ):
        answer = api.post("/v1/sessions", json={**OPEN, field: bad})
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, field)


def test_an_agent_is_told_its_task_and_the_modules_that_it_may_use(api) -> None:
    opened = api.post("/v1/sessions", json=OPEN).json()
    assert opened["briefing"] == briefing(builtin_tasks()["support-1"])
    assert opened["limits"]["calls"] == 2000
    for name, task in builtin_tasks().items():
        text, constraints = briefing(task), task.constraints
        assert task.statement.strip() in text, name
        offered = {*modules_named(constraints.modules), constraints.catalogue.start.name}
        for module in constraints.catalogue.values():
            shown = f"- {module.name} (" in text and f"mass {module.mass:g}" in text
            assert shown is (module.name in offered), (name, module.name)
            assert not shown or all(action in text for action in module.actions)


def test_nonsense_is_refused_and_kept(api, session) -> None:
    deep = {"a": {"b": [1e308] * 9}}
    for arguments in (None, [], "x", {"base_block": "\0"}, {"note": "\ud800"}, deep):
        answer = api.post(
            f"/v1/sessions/{session}/calls",
            content=json.dumps({"tool": "attach_block_to", "arguments": arguments}),
            headers={"content-type": "application/json"},
        )
        assert answer.status_code == 200, answer.text
        assert not answer.json()["ok"]
    assert api.get(f"/v1/sessions/{session}").json()["calls"] == 6


def test_what_a_submission_would_try_can_be_had_and_tried_before(api, session, act) -> None:
    path = f"/v1/sessions/{session}/machine"
    early = api.get(path)
    assert early.status_code == 409
    assert "there is no machine to simulate" in early.json()["detail"]
    act(session, "start", START)
    act(session, "attach_block_to", ATTACH)
    document = api.get(path).json()
    modules = [block["module"] for block in document["blocks"]]
    assert modules == ["Starting Block", "Small Wooden Block"]
    tried = api.post("/v1/machines/trials?task=support-1", content=json.dumps(document))
    assert tried.status_code == 201
    assert act(session, "attach_block_to", {**ATTACH, "face": "B"})["ok"]


def test_a_program_is_set_and_asked_in_a_session(api, open_session, act) -> None:
    session = open_session(task="landing-2", worlds=1)
    act(session, "start", START)
    flying = {**ATTACH, "face": "E", "new_block": "Flying Block"}
    assert act(session, "attach_block_to", flying)["ok"]
    program = "function control(t, sense) return { fly = sense.velocity.z < -1 and 1 or 0 } end"
    assert act(session, "set_controller", {"program": program})["ok"]
    ticks = [{"velocity.z": -0.5}, {"velocity.z": -2}]
    told = act(session, "test_controller", {"ticks": ticks})["feedback"].splitlines()
    assert [line.split(" and does ")[1] for line in told] == ["nothing.", "2.fly 1."]
    (main,) = api.get(f"/v1/sessions/{session}").json()["machines"]
    assert main["controller"] == program


def test_the_workbench_shows_every_face_as_geometry_has_it(api, open_session, act) -> None:
    session = open_session(task="transport-1", kind="human", agent="ada")
    assert api.get(f"/v1/sessions/{session}").json()["machines"] == []
    machine = Machine()
    wheel = {**ATTACH, "new_block": "Powered Wheel"}
    connect = {"block_a": "1", "face_a": "C", "block_b": "3", "face_b": "A", "connector": "Brace"}
    key = {"block_id": "2", "action": "spinning_forward", "new_key": "UpArrow"}
    for tool, arguments in (
        ("start", {"init_rotation": [30, 0, 0]}),
        ("attach_block_to", wheel),
        ("attach_block_to", {**ATTACH, "face": "B"}),
        ("attach_block_to", {**ATTACH, "base_block": "3"}),
        ("connect_blocks", connect),
        ("change_control_key", key),
        ("add_control_sequence", {"time": 0, "key": "UpArrow", "hold_for": 2}),
    ):
        assert act(session, tool, arguments)["ok"] == machine.act(tool, arguments).ok
    seen = api.get(f"/v1/sessions/{session}").json()
    assert (seen["open"], seen["calls"]) == (True, 7)
    (bench,) = seen["machines"]
    assert bench["control_sequence"] == [{"time_s": 0.0, "key": "UpArrow", "hold_for_s": 2.0}]
    parts = {part["id"]: part for part in bench["parts"]}
    assert list(parts) == [*machine.blocks, *machine.connectors]
    for block in machine.blocks.values():
        faces = parts[block.id]["faces"]
        assert [face["label"] for face in faces] == [face.label for face in block.module.faces]
        for face in faces:
            assert face["center"] == list(block.face_center(face["label"]))
            assert face["normal"] == list(block.face_normal(face["label"]))
            free = face["label"] in machine.state.free_faces(block)
            assert (face["taken_by"] is None) == free
    assert parts["1"]["faces"][0]["taken_by"] == "2"
    assert parts["5"]["ends"] == [["1", "C"], ["3", "A"]]
    # Looking changes nothing, and goes on after the end.
    api.post(f"/v1/sessions/{session}/submit")
    after = api.get(f"/v1/sessions/{session}").json()
    assert (after["open"], after["machines"]) == (False, seen["machines"])
