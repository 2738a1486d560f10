"""People who build by hand over the tools API: names, and the workbench with every face."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from support.clients.tenants import new_tenant, operator

from buildarena_geometry import Machine

OPEN = {"task": "transport-1", "agent": "ada", "seed": 1, "simulator": "mujoco", "kind": "human"}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Powered Wheel"}


def act(api, session: str, tool: str, arguments: object, **more: str):
    body = {"tool": tool, "arguments": arguments, **more}
    return api.post(f"/v1/sessions/{session}/calls", json=body)


@pytest.fixture
def session(api) -> str:
    answer = api.post("/v1/sessions", json=OPEN)
    assert answer.status_code == 201
    return answer.json()["id"]


def test_a_person_stands_on_the_external_track_under_an_own_name(api, session) -> None:
    act(api, session, "start", {})
    job = api.post(f"/v1/sessions/{session}/submit").json()
    assert job["model"] == "human/ada"
    assert job["track"].startswith("external+data-sheets/mujoco-")


@pytest.mark.parametrize("kinds", [("human", "agent"), ("agent", "human")])
def test_no_name_is_of_two_kinds(api, kinds) -> None:
    first, second = kinds
    assert api.post("/v1/sessions", json={**OPEN, "kind": first}).status_code == 201
    refused = api.post("/v1/sessions", json={**OPEN, "kind": second, "seed": 2})
    assert refused.status_code == 403
    assert "'ada'" in refused.json()["detail"]
    assert "choose another name" in refused.json()["detail"]
    assert api.post("/v1/sessions", json={**OPEN, "kind": first, "seed": 3}).status_code == 201


def test_of_two_kinds_that_want_a_name_at_once_one_gets_it(api) -> None:
    def opened(kind: str, name: str) -> int:
        return api.post("/v1/sessions", json={**OPEN, "kind": kind, "agent": name}).status_code

    with ThreadPoolExecutor(8) as pool:
        for name in ("a", "b", "c"):
            tries = [pool.submit(opened, kind, name) for kind in ("human", "agent") * 3]
            codes = [one.result() for one in tries]
            people, agents = codes[::2], codes[1::2]
            assert (403 in people) != (403 in agents), codes
            assert {code for code in codes if code != 403} <= {200, 201}


def test_an_admin_shares_no_name_between_kinds_either(guarded) -> None:
    admin = operator(guarded)
    admin.post("/v1/sessions", {**OPEN, "kind": "agent"}, status=201)
    admin.post("/v1/sessions", OPEN, status=403)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"agent": "a b"}, "agent"),
        ({"agent": "agent/x"}, "agent"),
        ({"agent": ""}, "agent"),
        ({"agent": "x" * 81}, "agent"),
        ({"kind": "robot"}, "kind"),
    ],
)
def test_bad_names_and_kinds_are_refused_in_words(api, change, field) -> None:
    answer = api.post("/v1/sessions", json={**OPEN, **change})
    assert answer.status_code == 422
    assert field in str(answer.json()["errors"])


def test_the_workbench_shows_every_face_as_geometry_has_it(api, session) -> None:
    machine = Machine()
    connect = {"block_a": "1", "face_a": "C", "block_b": "2", "face_b": "A", "connector": "Brace"}
    small = {**ATTACH, "face": "B", "new_block": "Small Wooden Block"}
    for tool, arguments in [
        ("start", {"init_rotation": [30, 0, 0]}),
        ("attach_block_to", ATTACH),
        ("attach_block_to", small),
        ("attach_block_to", {**small, "base_block": "3", "face": "A"}),
        ("connect_blocks", {**connect, "block_b": "3"}),
        (
            "change_control_key",
            {"block_id": "2", "action": "spinning_forward", "new_key": "UpArrow"},
        ),
        ("add_control_sequence", {"time": 0, "key": "UpArrow", "hold_for": 2}),
    ]:
        assert act(api, session, tool, arguments).json()["ok"] == machine.act(tool, arguments).ok
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
    assert parts["2"]["spins"]
    assert "spinning_forward" in parts["2"]["actions"]


def test_looking_changes_nothing_and_goes_on_after_the_end(api, session) -> None:
    assert api.get(f"/v1/sessions/{session}").json()["machines"] == []
    act(api, session, "start", {})
    before = api.get(f"/v1/sessions/{session}").json()
    assert api.get(f"/v1/sessions/{session}").json() == before
    api.post(f"/v1/sessions/{session}/submit")
    after = api.get(f"/v1/sessions/{session}").json()
    assert (after["open"], after["machines"]) == (False, before["machines"])


def test_a_job_that_is_no_session_is_none(api, sweep) -> None:
    made = api.post("/v1/sweeps", json=sweep).json()
    job = api.get("/v1/jobs", params={"sweep": made["id"]}).json()["jobs"][0]["id"]
    for unknown in (job, "job_none"):
        answer = api.get(f"/v1/sessions/{unknown}")
        assert answer.status_code == 404
        assert "session" in answer.json()["detail"]


def test_a_stranger_sees_and_cannot_touch(guarded) -> None:
    mine, other = new_tenant(guarded, "mine"), new_tenant(guarded, "other")
    session = mine.post("/v1/sessions", OPEN, status=201)["id"]
    assert other.get(f"/v1/sessions/{session}")["open"]
    body = {"tool": "start", "arguments": {}}
    other.post(f"/v1/sessions/{session}/calls", body, status=403)
    other.post("/v1/sessions", {**OPEN, "seed": 2}, status=403)


def test_modules_say_their_size_faces_and_actions(api) -> None:
    found = {one["name"]: one for one in api.get("/v1/modules").json()}
    assert found["Powered Wheel"]["size"] == [2, 2, 0.5]
    assert found["Powered Wheel"]["actions"] == ["spinning_forward", "spinning_backward"]
    assert found["Brace"]["size"] is None
    assert found["Small Wooden Block"]["faces"] == list("ABCDEF")
