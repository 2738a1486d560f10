"""Trajectories as Arrow, and scenes: a page can draw a trial without knowing physics."""

import json

import numpy as np
import pyarrow as pa
import pytest
from support.jobs import attach
from support.stages import work

from buildarena_api.http.negotiation import prefers
from buildarena_api.routes import trials
from buildarena_simulation import read_trajectory
from buildarena_simulation.arrow import MEDIA_TYPE as ARROW

PARQUET = trials.PARQUET


def submitted(api) -> str:
    body = {"task": "support-1", "model": "builtin/expert", "simulator": "mujoco"}
    return api.post("/v1/jobs", json=body).json()["id"]


def turned(quaternion, vector) -> np.ndarray:
    """The vector turned, by the textbook."""
    w, *xyz = quaternion
    axis = np.array(xyz)
    across = 2 * np.cross(axis, vector)
    return np.array(vector) + w * across + np.cross(axis, across)


@pytest.mark.ci
def test_arrow_says_what_parquet_says_and_the_scene_draws_it(api, context, monkeypatch) -> None:
    job = submitted(api)
    work(context)
    path = f"/v1/jobs/{job}/trajectory"
    kept = api.get(path)
    assert kept.headers["content-type"] == PARQUET
    assert kept.headers["vary"] == "Accept"
    answer = api.get(path, headers={"Accept": ARROW})
    assert answer.headers["content-type"] == ARROW
    assert answer.headers["etag"] != kept.headers["etag"]
    table = pa.ipc.open_stream(answer.content).read_all()
    trajectory = read_trajectory(kept.content)
    count, blocks = len(trajectory.time_s), len(trajectory.block_ids)
    assert table.num_rows == count
    assert len(table.to_batches()) == 1
    for name in ("positions", "quaternions", "pieces", "cargo_position", "heated"):
        column = table.column(name).combine_chunks() if name in table.column_names else None
        wanted = getattr(trajectory, name)
        if column is None:
            assert wanted.size == 0
            continue
        assert pa.types.is_fixed_size_list(column.type)
        np.testing.assert_array_equal(
            column.flatten().to_numpy(zero_copy_only=False), wanted.reshape(-1)
        )
    loads = table.column("joint_loads").combine_chunks()
    assert loads.type.list_size == len(trajectory.joint_peaks)
    np.testing.assert_array_equal(loads.flatten().to_numpy(), trajectory.joint_loads.reshape(-1))
    np.testing.assert_array_equal(table.column("time_s").to_numpy(), trajectory.time_s)
    np.testing.assert_array_equal(table.column("cargo_mass").to_numpy(), trajectory.cargo_mass)
    facts = json.loads(table.schema.metadata[b"buildarena.trajectory"])
    assert tuple(facts["block_ids"]) == trajectory.block_ids
    assert len(facts["joint_peaks"]) == len(trajectory.joint_peaks) > 0
    _check_scene(api, job, trajectory, count, blocks)
    known = {"Accept": ARROW, "If-None-Match": answer.headers["etag"]}
    assert api.get(path, headers=known).status_code == 304
    assert api.get(path, params={"number": 7}).status_code == 404
    assert api.get(f"/v1/jobs/{job}/scene", params={"number": 7}).status_code == 404
    monkeypatch.setattr(trials, "MAX_ARROW_BYTES", 1000)
    refused = api.get(path, headers={"Accept": ARROW})
    assert refused.status_code == 413
    assert PARQUET in refused.json()["detail"]
    assert api.get(path).status_code == 200


def _check_scene(api, job, trajectory, count, blocks) -> None:
    scene = api.get(f"/v1/jobs/{job}/scene").json()
    assert scene["scenario"]["duration_s"] == (count - 1) / 25
    assert scene["scenario"]["cargo"]
    machine = scene["machine"]
    assert len(machine["blocks"]) == blocks
    # Everything that holds together at the start is where it was built, moved as one.
    first = machine["blocks"][0]
    turns = []
    for place in machine["blocks"]:
        k = trajectory.block_ids.index(place["id"])
        module = machine["modules"][place["module"]]
        assert module["bodies"]
        shown = np.array(trajectory.positions[0, k], float)
        quaternion = trajectory.quaternions[0, k]
        root = shown - turned(quaternion, module["center"])
        built = np.array(place["position"]) - np.array(first["position"])
        turns.append((root, built))
    moved = np.array([root - turns[0][0] for root, _ in turns])
    apart = np.array([built for _, built in turns])
    np.testing.assert_allclose(
        np.linalg.norm(moved, axis=1), np.linalg.norm(apart, axis=1), atol=0.01
    )
    for link in machine["connectors"]:
        assert {link["start"]["block"], link["end"]["block"]} <= set(trajectory.block_ids)
    joints = {peak.joint for peak in trajectory.joint_peaks}
    assert {link["joint"] for link in machine["connectors"]} <= joints


def test_a_scene_is_there_before_anything_is_built(api, context) -> None:
    job = submitted(api)
    before = api.get(f"/v1/jobs/{job}/scene").json()
    assert before["machine"] is None
    assert before["scenario"]["terrain"]
    work(context, steps=1)
    assert api.get(f"/v1/jobs/{job}/scene").json()["machine"]["blocks"]
    assert api.get(f"/v1/jobs/{job}/trajectory").status_code == 404


def test_bytes_that_are_no_trajectory_are_a_problem(api, context) -> None:
    job = submitted(api)
    attach(context, job, {"trajectory-0": b"nothing"}, PARQUET)
    answer = api.get(f"/v1/jobs/{job}/trajectory", headers={"Accept": ARROW})
    assert answer.status_code == 404
    assert "can be read" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("accept", "wanted"),
    [
        ("", False),
        ("*/*", False),
        (PARQUET, False),
        (ARROW, True),
        (ARROW.upper(), True),
        (f"{PARQUET}, {ARROW}", True),
        (f"{PARQUET}, {ARROW};q=0.5", False),
        (f"{ARROW};q=0", False),
        (f"{ARROW};q=x", False),
        (f"{ARROW}, */*;q=0.1", True),
        (f"{ARROW}x", False),
        (",,;", False),
    ],
)
def test_what_is_asked_for_is_what_is_named(accept, wanted) -> None:
    assert prefers(accept, ARROW, over=PARQUET) is wanted
