"""What a job left to look at: its replay, its trial as Arrow and as a scene, and pictures."""

import io
import json
import struct

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image
from support.jobs import attach
from support.stages import work

from buildarena_api.http.etags import ResponseCache
from buildarena_api.replays import Replays
from buildarena_api.routes import trials
from buildarena_backend.replays import chapters
from buildarena_simulation import read_trajectory
from buildarena_simulation.arrow import MEDIA_TYPE as ARROW

PARQUET = trials.PARQUET
START = {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0], "note": ""}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""}
CHANGES = ("added", "moved", "removed", "rebound")


def assert_ends_in(replay: dict, document: dict) -> None:
    """Who only reads the steps of the last chapter has the machine."""
    found: dict[str, dict] = {}
    for step in replay["chapters"][-1]["steps"]:
        for part in (*step["added"], *step["moved"], *step["rebound"]):
            found[part["id"]] = part
        for gone in step["removed"]:
            del found[gone]
    kept = {one["id"]: one for one in (*document["blocks"], *document["connectors"])}
    assert found.keys() == kept.keys()
    for id_, part in kept.items():
        told = {"bindings": {}, "flipped": False, **part}
        for name in ("module", "position", "quaternion", "bindings", "flipped"):
            assert found[id_][name] == told[name]


@pytest.mark.parametrize(
    "case",
    [
        ("support-1", "builtin/random", "five-role"),
        ("transport-1", "builtin/expert", "builder"),
        ("transport-1", "builtin/random", "builder"),
    ],
)
def test_a_replay_ends_in_the_kept_machine(api, context, submit_job, case) -> None:
    task, model, workflow = case
    job = submit_job(task=task, model=model, workflow=workflow)
    work(context, steps=1)
    turns = api.get(f"/v1/jobs/{job}/transcript").json()["turns"]
    replay = api.get(f"/v1/jobs/{job}/replay").json()
    assert replay["complete"]
    assert replay["exact"]
    assert_ends_in(replay, api.get(f"/v1/jobs/{job}/machine").json())
    steps = [step for chapter in replay["chapters"] for step in chapter["steps"]]
    acted = [(turn["index"], action) for turn in turns for action in turn["actions"]]
    told = [step for step in steps if not step["action"].startswith("add_control")]
    assert [step["turn"] for step in told] == [index for index, _ in acted]
    for step, (_, action) in zip(told, acted, strict=True):
        assert (step["action"], step["arguments"]) == (action["name"], action["arguments"])
        assert (step["accepted"], step["reason"]) == (action["ok"], action["reason"])
    programmed = {step["turn"] for step in steps if step["action"].startswith("add_control")}
    controlled = [turn["index"] for turn in turns if turn["stage"] == "control"]
    assert bool(programmed) == (model == "builtin/expert" and bool(controlled))
    assert programmed <= set(controlled[-1:])
    # It is made once and not sent twice.
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Replays, "_build", None)
        again = api.get(f"/v1/jobs/{job}/replay")
    assert again.json() == replay
    known = {"If-None-Match": again.headers["etag"]}
    assert api.get(f"/v1/jobs/{job}/replay", headers=known).status_code == 304


def test_an_agents_sub_structures_are_chapters_that_grow(api, context, open_session, act) -> None:
    job = open_session(task="support-2")
    path = f"/v1/jobs/{job}/replay"
    assert api.get(path).status_code == 404
    act(job, "start", START, "left")
    act(job, "start", START, "right")
    act(job, "attach_block_to", ATTACH, "left")
    first = api.get(path).json()
    steps = {one["name"]: len(one["steps"]) for one in first["chapters"]}
    assert (steps, first["exact"]) == ({"left": 2, "right": 1}, None)
    for machine, shift in (("left", [0, 0, 0]), ("right", [3, 0, 0])):
        given = {"machine_id": machine, "init_shift": shift, "init_rotation": [0, 0, 0]}
        act(job, "add_machine", given, "assembly")
    act(job, "shift_machine", {"machine_index": "B", "position": [0, 1, 0]}, "assembly")
    assert api.post(f"/v1/sessions/{job}/submit").status_code == 200
    replay = api.get(path).json()
    kinds = [one["kind"] for one in replay["chapters"]]
    assert kinds == ["sub_structure", "sub_structure", "assembly"]
    assert replay["exact"]
    moved = replay["chapters"][-1]["steps"][-1]
    assert ([part["id"] for part in moved["moved"]], moved["turn"]) == (["B_1"], 5)
    assert_ends_in(replay, api.get(f"/v1/jobs/{job}/machine").json())
    # A machine that is none is a problem and no failure.
    attach(context, job, {"machine": b'{"version": 99}'})
    answer = api.get(path)
    assert (answer.status_code, "does not read" in answer.json()["detail"]) == (404, True)


def test_a_refused_action_says_why_and_where(api, open_session, act) -> None:
    job = open_session()
    act(job, "start", START)
    act(job, "attach_block_to", ATTACH)
    refusals = (
        ("attach_block_to", ATTACH, "face_occupied", [("3", "Small Wooden Block")]),
        ("attach_block_to", {**ATTACH, "new_block": "Nothing"}, "module_restriction", []),
        ("start", START, "multiple_initialization", []),
        ("no_such_tool", {}, "unknown_action", []),
        ("attach_block_to", "text", "malformed_arguments", []),
    )
    for tool, arguments, *_ in refusals:
        act(job, tool, arguments)
    _, accepted, *steps = api.get(f"/v1/jobs/{job}/replay").json()["chapters"][0]["steps"]
    for step, (_, _, reason, attempted) in zip(steps, refusals, strict=True):
        assert (step["accepted"], step["reason"], bool(step["text"])) == (False, reason, True)
        assert [step[name] for name in CHANGES] == [[]] * 4
        assert [(one["id"], one["module"]) for one in step["attempted"]] == attempted
    assert steps[0]["attempted"][0]["position"] == accepted["added"][0]["position"]


@pytest.mark.parametrize("bound", ["MAX_PARTS_TOLD", "MAX_WORK"])
def test_a_replay_that_is_too_large_says_so(api, open_session, act, monkeypatch, bound) -> None:
    monkeypatch.setattr(chapters, bound, 3)
    job = open_session()
    act(job, "start", START)
    for face in "ABCD":
        act(job, "attach_block_to", {**ATTACH, "face": face})
    replay = api.get(f"/v1/jobs/{job}/replay").json()
    assert not replay["complete"]
    assert 1 <= len(replay["chapters"][0]["steps"]) <= 3
    assert api.post(f"/v1/sessions/{job}/submit").status_code == 200
    assert api.get(f"/v1/jobs/{job}/replay").json()["exact"] is False


@pytest.mark.ci
def test_arrow_says_what_parquet_and_scene_say(api, context, submit_job, monkeypatch) -> None:
    job = submit_job()
    work(context)
    path = f"/v1/jobs/{job}/trajectory"
    kept, answer = api.get(path), api.get(path, headers={"Accept": ARROW})
    assert (kept.headers["content-type"], kept.headers["vary"]) == (PARQUET, "Accept")
    assert answer.headers["content-type"] == ARROW
    assert answer.headers["etag"] != kept.headers["etag"]
    table = pa.ipc.open_stream(answer.content).read_all()
    trajectory = read_trajectory(kept.content)
    count, blocks = len(trajectory.time_s), len(trajectory.block_ids)
    assert table.num_rows == count
    names = ("positions", "quaternions", "pieces", "cargo_position", "heated", "joint_loads")
    for name in (*names, "time_s", "cargo_mass"):
        wanted = getattr(trajectory, name)
        if name not in table.column_names:
            assert wanted.size == 0
            continue
        column = table.column(name).combine_chunks()
        flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
        found = flat.to_numpy(zero_copy_only=False)
        np.testing.assert_array_equal(found, wanted.reshape(-1))
    facts = json.loads(table.schema.metadata[b"buildarena.trajectory"])
    assert tuple(facts["block_ids"]) == trajectory.block_ids
    assert len(facts["joint_peaks"]) == len(trajectory.joint_peaks) > 0
    scene = api.get(f"/v1/jobs/{job}/scene").json()
    # The trial ends when it is decided, which may be earlier.
    assert scene["scenario"]["duration_s"] >= trajectory.time_s[-1]
    assert scene["scenario"]["cargo"]
    _check_places(scene["machine"], trajectory, blocks)
    known = {"Accept": ARROW, "If-None-Match": answer.headers["etag"]}
    assert api.get(path, headers=known).status_code == 304
    assert api.get(path, params={"number": 7}).status_code == 404
    assert api.get(f"/v1/jobs/{job}/scene", params={"number": 7}).status_code == 404
    monkeypatch.setattr(trials, "MAX_ARROW_BYTES", 1000)
    refused = api.get(path, headers={"Accept": ARROW})
    assert (refused.status_code, PARQUET in refused.json()["detail"]) == (413, True)
    assert api.get(path).status_code == 200


def _check_places(machine, trajectory, blocks) -> None:
    """Everything that holds together at the start is where it was built, moved as one."""
    assert len(machine["blocks"]) == blocks
    roots, built = [], []
    for place in machine["blocks"]:
        k = trajectory.block_ids.index(place["id"])
        module = machine["modules"][place["module"]]
        assert module["bodies"]
        w, *axis = trajectory.quaternions[0, k]
        across = 2 * np.cross(axis, module["center"])
        center = np.array(module["center"]) + w * across + np.cross(axis, across)
        roots.append(np.array(trajectory.positions[0, k], float) - center)
        built.append(place["position"])
    moved, apart = np.array(roots) - roots[0], np.array(built) - built[0]
    lengths = (np.linalg.norm(moved, axis=1), np.linalg.norm(apart, axis=1))
    np.testing.assert_allclose(*lengths, atol=0.01)
    joints = {peak.joint for peak in trajectory.joint_peaks}
    for link in machine["connectors"]:
        assert {link["start"]["block"], link["end"]["block"]} <= set(trajectory.block_ids)
        assert link["joint"] in joints


def nodes(glb: bytes) -> list[str]:
    """Names of the nodes under the root, as a viewer reads them."""
    magic, version, length = struct.unpack_from("<III", glb)
    assert (magic, version, length) == (0x46546C67, 2, len(glb))
    (size,) = struct.unpack_from("<I", glb, 12)
    scene = json.loads(glb[20 : 20 + size])
    return [scene["nodes"][child]["name"] for child in scene["nodes"][0]["children"]]


def test_scenes_and_pictures_are_there_once_it_is_built(
    api, context, submit_job, monkeypatch
) -> None:
    job = submit_job()
    path = f"/v1/jobs/{job}"
    before = api.get(f"{path}/scene").json()
    assert before["machine"] is None
    assert before["scenario"]["terrain"]
    for name in ("machine.glb", "thumbnail.png"):
        assert api.get(f"{path}/{name}").status_code == 404
    work(context, steps=1)
    assert api.get(f"{path}/scene").json()["machine"]["blocks"]
    assert api.get(f"{path}/trajectory").status_code == 404
    document = api.get(f"{path}/machine").json()
    parts = [one["id"] for one in (*document["blocks"], *document["connectors"])]
    assert nodes(api.get(f"{path}/machine.glb").content) == parts
    drawn = api.get(f"{path}/thumbnail.png")
    assert drawn.headers["content-type"] == "image/png"
    colours = Image.open(io.BytesIO(drawn.content)).convert("RGB").getcolors(100_000)
    assert len(colours) > 8, "there is a machine on it"
    # What may still change is no artifact.
    assert "thumbnail" not in context.store.jobs.artifacts(job)
    work(context)
    ended = api.get(f"{path}/thumbnail.png")
    assert ended.content == drawn.content
    assert context.artifacts.get(context.store.jobs.artifacts(job)["thumbnail"]) == drawn.content
    kept = api.get(f"{path}/artifacts/thumbnail")
    assert kept.headers["content-security-policy"] == "sandbox"
    assert kept.headers["content-type"] == "image/png"
    monkeypatch.setattr(trials, "still_png", None)
    api.app.state.services.pictures._cached.clear()
    assert api.get(f"{path}/thumbnail.png").content == drawn.content
    # Bytes that are no trajectory are a problem and no failure.
    attach(context, job, {"trajectory-0": b"nothing"}, PARQUET)
    answer = api.get(f"{path}/trajectory", headers={"Accept": ARROW})
    assert (answer.status_code, "can be read" in answer.json()["detail"]) == (404, True)


def test_answers_are_forgotten_when_there_is_no_room() -> None:
    kept = ResponseCache(10)
    made: list[str] = []

    def get(name: str, size: int = 5) -> int:
        return len(kept.get_or_make(name, lambda: made.append(name) or b"x" * size).body)

    # c takes the place of b, which was used longest ago.
    for name in ("a", "b", "a", "c", "a", "b"):
        get(name)
    assert get("huge", 1000) == 1000
    get("a")
    assert made == ["a", "b", "c", "b", "huge"]
