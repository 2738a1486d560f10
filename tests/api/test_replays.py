"""How machines came about: replays of models' and agents' sessions."""

import pytest
from support.jobs import attach
from support.stages import work

from buildarena_api.replays.making import Replays
from buildarena_pipeline.replays import chapters

START = {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0], "note": ""}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""}


def submitted(api, model: str, task: str = "support-1", **more: object) -> str:
    body = {"task": task, "model": model, "simulator": "mujoco", **more}
    answer = api.post("/v1/jobs", json=body)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


def opened(api, task: str = "support-1") -> str:
    body = {"task": task, "agent": "me", "seed": 1, "simulator": "mujoco"}
    return api.post("/v1/sessions", json=body).json()["id"]


def act(api, session: str, tool: str, arguments: object, machine: str = "main") -> None:
    body = {"tool": tool, "arguments": arguments, "machine": machine}
    assert api.post(f"/v1/sessions/{session}/calls", json=body).status_code == 200


def final_parts(replay: dict) -> dict[str, dict]:
    """What somebody has who only reads the steps of the last chapter."""
    parts: dict[str, dict] = {}
    for step in replay["chapters"][-1]["steps"]:
        for part in (*step["added"], *step["moved"], *step["rebound"]):
            parts[part["id"]] = part
        for gone in step["removed"]:
            del parts[gone]
    return parts


def assert_ends_in(replay: dict, document: dict) -> None:
    found = final_parts(replay)
    kept = {one["id"]: one for one in (*document["blocks"], *document["connectors"])}
    assert found.keys() == kept.keys()
    for id_, part in kept.items():
        told = {"bindings": {}, "flipped": False, **part}
        for name in ("module", "position", "quaternion", "bindings", "flipped"):
            assert found[id_][name] == told[name]


@pytest.mark.parametrize("model", ["builtin/expert", "builtin/random"])
@pytest.mark.parametrize("workflow", ["five-role", "builder"])
@pytest.mark.parametrize("task", ["support-1", "transport-1"])
def test_a_replay_ends_in_the_kept_machine(api, context, model, workflow, task) -> None:
    job = submitted(api, model, task, workflow=workflow)
    work(context, steps=1)
    document = api.get(f"/v1/jobs/{job}/machine").json()
    turns = api.get(f"/v1/jobs/{job}/transcript").json()["turns"]
    replay = api.get(f"/v1/jobs/{job}/replay").json()
    assert replay["complete"]
    assert replay["exact"]
    assert_ends_in(replay, document)
    steps = [step for chapter in replay["chapters"] for step in chapter["steps"]]
    acted = [(turn["index"], action) for turn in turns for action in turn["actions"]]
    told = [step for step in steps if not step["action"].startswith("add_control")]
    assert [step["turn"] for step in told] == [index for index, _ in acted]
    for step, (_, action) in zip(told, acted, strict=True):
        assert (step["action"], step["arguments"]) == (action["name"], action["arguments"])
        assert (step["accepted"], step["reason"]) == (action["ok"], action["reason"])
    programmed = [step for step in steps if step["action"].startswith("add_control")]
    controlled = [turn["index"] for turn in turns if turn["stage"] == "control"]
    assert bool(programmed) == (model == "builtin/expert" and bool(controlled))
    assert {step["turn"] for step in programmed} <= set(controlled[-1:])


def test_an_agents_sub_structures_are_chapters_and_grow_while_it_builds(api) -> None:
    job = opened(api, "support-2")
    assert api.get(f"/v1/jobs/{job}/replay").status_code == 404
    act(api, job, "start", START, "left")
    act(api, job, "start", START, "right")
    act(api, job, "attach_block_to", ATTACH, "left")
    first = api.get(f"/v1/jobs/{job}/replay").json()
    steps = {one["name"]: len(one["steps"]) for one in first["chapters"]}
    assert steps == {"left": 2, "right": 1}
    assert first["exact"] is None
    for machine, shift in (("left", [0, 0, 0]), ("right", [3, 0, 0])):
        given = {"machine_id": machine, "init_shift": shift, "init_rotation": [0, 0, 0]}
        act(api, job, "add_machine", given, "assembly")
    act(api, job, "shift_machine", {"machine_index": "B", "position": [0, 1, 0]}, "assembly")
    assert api.post(f"/v1/sessions/{job}/submit").status_code == 202
    replay = api.get(f"/v1/jobs/{job}/replay").json()
    kinds = [one["kind"] for one in replay["chapters"]]
    assert kinds == ["sub_structure", "sub_structure", "assembly"]
    assert replay["exact"]
    moved = replay["chapters"][-1]["steps"][-1]
    assert [part["id"] for part in moved["moved"]] == ["B_1"]
    assert moved["turn"] == 5
    assert_ends_in(replay, api.get(f"/v1/jobs/{job}/machine").json())


@pytest.mark.parametrize(
    ("tool", "arguments", "reason", "attempted"),
    [
        ("attach_block_to", ATTACH, "face_occupied", [("3", "Small Wooden Block")]),
        ("attach_block_to", {**ATTACH, "new_block": "Nothing"}, "module_restriction", []),
        ("start", START, "multiple_initialization", []),
        ("no_such_tool", {}, "unknown_action", []),
        ("attach_block_to", "text", "malformed_arguments", []),
    ],
)
def test_a_refused_action_says_why_and_where(api, tool, arguments, reason, attempted) -> None:
    job = opened(api)
    act(api, job, "start", START)
    act(api, job, "attach_block_to", ATTACH)
    act(api, job, tool, arguments)
    *_, accepted, refused = api.get(f"/v1/jobs/{job}/replay").json()["chapters"][0]["steps"]
    assert not refused["accepted"]
    assert refused["reason"] == reason
    assert refused["text"]
    assert [refused[name] for name in ("added", "moved", "removed", "rebound")] == [[]] * 4
    assert [(one["id"], one["module"]) for one in refused["attempted"]] == attempted
    if attempted:
        placed = accepted["added"][0]
        assert refused["attempted"][0]["position"] == placed["position"]


def test_an_overlapping_block_is_shown_where_it_would_have_been(api) -> None:
    job = opened(api)
    act(api, job, "start", START)
    act(api, job, "attach_block_to", ATTACH)
    # Blocks on neighbouring sides want the same corner.
    for base in range(1, 6):
        for face in "ABCDEFGHI":
            act(api, job, "attach_block_to", {**ATTACH, "base_block": str(base), "face": face})
    steps = api.get(f"/v1/jobs/{job}/replay").json()["chapters"][0]["steps"]
    overlaps = [step for step in steps if step["reason"] == "overlap"]
    assert overlaps
    assert all(len(step["attempted"]) == 1 for step in overlaps)


def test_a_replay_is_made_once_and_not_sent_twice(api, context, monkeypatch) -> None:
    job = submitted(api, "builtin/expert")
    work(context, steps=1)
    first = api.get(f"/v1/jobs/{job}/replay")
    monkeypatch.setattr(Replays, "_made", None)
    again = api.get(f"/v1/jobs/{job}/replay")
    assert again.content == first.content
    known = {"If-None-Match": first.headers["etag"]}
    assert api.get(f"/v1/jobs/{job}/replay", headers=known).status_code == 304


@pytest.mark.parametrize("bound", ["MAX_PARTS_TOLD", "MAX_WORK"])
def test_a_replay_that_would_be_too_large_says_that_it_ends_early(api, monkeypatch, bound) -> None:
    monkeypatch.setattr(chapters, bound, 3)
    job = opened(api)
    act(api, job, "start", START)
    for face in "ABCD":
        act(api, job, "attach_block_to", {**ATTACH, "face": face})
    replay = api.get(f"/v1/jobs/{job}/replay").json()
    assert not replay["complete"]
    assert 1 <= len(replay["chapters"][0]["steps"]) <= 3
    assert api.post(f"/v1/sessions/{job}/submit").status_code == 202
    assert api.get(f"/v1/jobs/{job}/replay").json()["exact"] is False


def test_a_machine_that_is_none_is_a_problem_and_no_failure(api, context) -> None:
    job = opened(api)
    act(api, job, "start", START)
    assert api.post(f"/v1/sessions/{job}/submit").status_code == 202
    attach(context, job, {"machine": b'{"version": 99}'})
    answer = api.get(f"/v1/jobs/{job}/replay")
    assert answer.status_code == 404
    assert "does not read" in answer.json()["detail"]


def test_replays_need_a_key_where_keys_are_needed(guarded) -> None:
    assert guarded.get("/v1/jobs/job_x/replay").status_code == 401
