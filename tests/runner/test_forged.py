"""Nothing that a runner sends is believed: forged, stale and repeated outcomes change nothing."""

import io
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.clients.tenants import everything
from support.jobs import expire_leases
from support.servers.runner_rig import (
    CARRY,
    VERSIONS,
    Caller,
    ended,
    pause_ends,
    runner_key,
    true_trajectory,
    waiting,
)

from buildarena_simulation import SIMULATION_VERSION, Trajectory, write_trajectory
from buildarena_store import ArtifactStoreError

LONG = "x" * 500


@pytest.fixture
def caller(context, url) -> Caller:
    return Caller(url, runner_key(context)[1])


def changed(array: np.ndarray, change: Callable[[np.ndarray], object]) -> np.ndarray:
    made = array.copy()
    change(made)
    return made


def moved(array: np.ndarray, by: float = 0.0) -> np.ndarray:
    return array + np.float32(by)


def opened(data: bytes) -> tuple[pa.Table, dict[str, object]]:
    table = pq.read_table(io.BytesIO(data))
    return table, json.loads(table.schema.metadata[b"buildarena.trajectory"])


def rows(data: bytes) -> int:
    return pq.read_metadata(io.BytesIO(data)).num_rows


def with_facts(data: bytes, **facts: object) -> bytes:
    """The file with other facts in its metadata, as no writer of ours would write it."""
    table, kept = opened(data)
    return packed(table, {**kept, **facts})


def packed(table: pa.Table, facts: object, **options: object) -> bytes:
    out = io.BytesIO()
    key = {b"buildarena.trajectory": json.dumps(facts).encode()}
    options = {"compression": "zstd", "use_dictionary": False, **options}
    pq.write_table(table.replace_schema_metadata(key), out, **options)
    return out.getvalue()


def with_column(data: bytes, name: str, column: pa.Array | None) -> bytes:
    table, facts = opened(data)
    table = table.drop_columns([name])
    return packed(table if column is None else table.append_column(name, column), facts)


def nan_between(array: np.ndarray) -> None:
    array[3] = np.nan


OTHERS: dict[str, Callable[[Trajectory], Trajectory]] = {
    "blocks of another machine": lambda t: replace(t, block_ids=("1", "3")),
    "blocks in another order": lambda t: replace(t, block_ids=t.block_ids[::-1]),
    "one block twice": lambda t: replace(t, block_ids=("1", "1")),
    "another time base": lambda t: replace(t, time_s=t.time_s * 2),
    "times that stand still": lambda t: replace(t, time_s=np.zeros_like(t.time_s)),
    "another start": lambda t: replace(t, positions=moved(t.positions, 5.0)),
    "a start a little higher": lambda t: replace(t, positions=moved(t.positions, 0.01)),
    "a hole in the middle": lambda t: replace(t, positions=changed(t.positions, nan_between)),
    "infinity between figures": lambda t: replace(
        t, quaternions=changed(t.quaternions, lambda a: a.__setitem__(2, np.inf))
    ),
    "loads that are no figures": lambda t: replace(
        t, joint_loads=changed(t.joint_loads, lambda a: a.fill(np.nan))
    ),
    "another engine": lambda t: replace(t, engine="pybullet"),
    "another version": lambda t: replace(t, simulation_version="2"),
    "an engine that manifests do not have": lambda t: replace(t, engine_version="0.0.1"),
    "another scenario": lambda t: replace(t, settings={**t.settings, "scenario": "0" * 16}),
    "another key pressed": lambda t: replace(
        t, settings={**t.settings, "presses": '[["UpArrow",0.0,1.0]]'}
    ),
    "no keys told": lambda t: replace(
        t, settings={k: v for k, v in t.settings.items() if k != "presses"}
    ),
    "no scenario": lambda t: replace(t, settings={}),
    "a varied start": lambda t: replace(t, settings={**t.settings, "seed": 1}),
    "a setting without end": lambda t: replace(t, settings={**t.settings, "note": LONG}),
    "a setting that is no figure": lambda t: replace(
        t, settings={**t.settings, "gravity": float("inf")}
    ),
    "joints of another machine": lambda t: replace(
        t, joint_peaks=(), joint_loads=t.joint_loads[:, :0]
    ),
    "no pieces": lambda t: replace(t, pieces=None),
    "pieces of others": lambda t: replace(t, pieces=changed(t.pieces, lambda a: a.fill(99))),
    "no bearing": lambda t: replace(t, bearing=None),
    "cannons that it has not": lambda t: replace(
        t, cannon_ids=("2",), heated=np.zeros((len(t.time_s), 1), dtype=bool)
    ),
    "a heavier cargo": lambda t: replace(t, cargo_mass=t.cargo_mass * 2),
    "a smaller cargo": lambda t: replace(t, cargo_size=(0.1, 0.1, 0.1)),
    "a cargo elsewhere": lambda t: replace(t, cargo_position=moved(t.cargo_position, 1.0)),
    "no cargo": lambda t: replace(
        t, cargo_position=None, cargo_quaternion=None, cargo_mass=None, cargo_size=None
    ),
}


@pytest.fixture
def refused(context, caller) -> Callable[..., str]:
    """Sends outcomes that must be refused and change nothing; returns what the answers say."""
    job = waiting(context, CARRY)
    lease = caller.lease()
    true = true_trajectory(context, job)

    def send(make: Callable[[Trajectory], Trajectory | bytes | None], **more: object) -> str:
        made = make(true)
        data = write_trajectory(made) if isinstance(made, Trajectory) else made
        beat = caller.ask("POST", "/heartbeat", json=caller.about(leases=[caller.named(lease)]))
        assert len(beat.json()["live"]) == 1
        before = everything(context.store.database)
        answer = caller.outcome(lease, data, **more)
        assert answer.status_code == 422, answer.text
        assert everything(context.store.database) == before
        return answer.text

    yield send
    # What it really came to is taken all the same.
    assert caller.outcome(lease, write_trajectory(true)).json() == {"status": "done"}
    ended(context, job)


@pytest.mark.ci
def test_trajectories_of_something_else_are_refused(refused) -> None:
    said = {name: refused(make) for name, make in OTHERS.items()}
    assert "'3'" in said["blocks of another machine"]
    assert "another mass" in said["a heavier cargo"]
    assert "starts at another place" in said["a start a little higher"]


FILES: dict[str, Callable[[bytes], bytes]] = {
    "nothing": lambda _: b"",
    "no Parquet": lambda _: b"PAR1 no, not really PAR1",
    "half a file": lambda data: data[: len(data) // 2],
    "a file without its start": lambda data: data[100:],
    "bytes changed in the middle": lambda data: data[:200] + bytes(200) + data[400:],
    "no facts": lambda data: packed(opened(data)[0], {}),
    "facts of another kind": lambda data: packed(opened(data)[0], [1]),
    "an older schema": lambda data: with_facts(data, schema_version=2),
    "a schema to come": lambda data: with_facts(data, schema_version=99),
    "a schema that is no number": lambda data: with_facts(data, schema_version="3x"),
    "an unknown fact": lambda data: with_facts(data, success=True),
    "peaks of another shape": lambda data: with_facts(data, joint_peaks=[{"joint": 1}]),
    "ids that are no texts": lambda data: with_facts(data, block_ids=[1, 2]),
    "settings that are none": lambda data: with_facts(data, settings=[1]),
    "a column less": lambda data: with_column(data, "positions", None),
    "a column of texts": lambda data: with_column(
        data, "positions", pa.array([["a"] * 6] * rows(data))
    ),
    "rows of different lengths": lambda data: with_column(
        data, "quaternions", pa.array([[1.0] * k for k in range(rows(data))])
    ),
    "fewer instants": lambda data: packed(opened(data)[0].slice(0, 5), opened(data)[1]),
    "several row groups": lambda data: packed(*opened(data), row_group_size=4),
    "a dictionary": lambda data: packed(*opened(data), use_dictionary=True),
    "far too much": lambda data: with_column(
        data, "heated", pa.array([np.zeros(40_000)] * rows(data))
    ),
}


@pytest.mark.ci
def test_files_that_are_no_trajectories_are_refused(refused) -> None:
    for name, make in FILES.items():
        said = refused(lambda true, make=make: make(write_trajectory(true)))
        assert said, name


@pytest.mark.ci
def test_what_is_said_beside_a_trajectory_is_checked(refused) -> None:
    same: Callable[[Trajectory], Trajectory] = lambda true: true  # noqa: E731
    for versions in (
        {},
        {**VERSIONS, "engine": "pybullet"},
        {**VERSIONS, "simulation": "999"},
        {**VERSIONS, "engine_version": "1"},
        {**VERSIONS, "note": LONG * 10},
        {**VERSIONS, "deep": {"a": {"b": {"c": 1}}}},
        {f"k{n}": 1 for n in range(100)},
    ):
        refused(same, versions=versions)
    refused(same, score={"success": True})
    refused(same, success=True, indicator=1e9)
    for wall_s in (-1, 1e9, "NaN"):
        refused(same, wall_s=wall_s)
    said = {"success": True, "indicator": 1.0, "flags": []}
    for engine in ("mujoco", "unity"):
        told = {**said, "simulation": SIMULATION_VERSION, "engine_version": "1"}
        refused(same, annotations={engine: told})
    assert "does not refuse this machine" in refused(lambda _: None)


NAMES = [
    *("machine", "trajectory-0", "transcript", "log-1.txt", "log-00.txt", "log-0.TXT"),
    *("../log-0.txt", "log-0.txt/../../x", "/etc/log-0.txt", "log-0\\x.txt", "log-0.txt\n"),
    *("log-0.html", "log-0.svg", "log-0", "page-0.txt", "log-0.txt\x00", "lög-0.txt", ""),
]


def test_names_that_are_not_this_trials_are_refused(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    sent = caller.upload(lease, write_trajectory(true_trajectory(context, job)))
    beat = caller.about(leases=[caller.named(lease)])
    assert caller.ask("POST", "/heartbeat", json=beat).json()["live"]
    before = everything(context.store.database)
    body = {"trajectory": sent, "versions": VERSIONS, "wall_s": 1}
    for name in NAMES:
        files = [{"name": name, **sent}]
        answer = caller.ask("POST", caller.at(lease, "/outcome"), json={**body, "files": files})
        assert answer.status_code == 422, name
        fault = {"reason": "simulator_fault", "detail": "b", "files": files}
        answer = caller.ask("POST", caller.at(lease, "/fault"), json=fault)
        assert answer.status_code == 422, name
    assert everything(context.store.database) == before
    assert context.store.jobs.artifacts(job.id).keys() == {"machine"}


def test_a_file_comes_once(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    data = write_trajectory(true_trajectory(context, job))
    files = [{"name": "log-0.txt", **caller.upload(lease, b"text")}] * 2
    assert caller.outcome(lease, data, files=files).status_code == 422
    many = [{**files[0], "name": f"screenshot-0-{n}.png"} for n in range(20)]
    assert caller.outcome(lease, data, files=many).status_code == 422
    # What was uploaded for an outcome that was refused is gone.
    caller.upload(lease, b"text")
    assert caller.outcome(lease, data, files=files[:1]).status_code == 200


def test_a_blown_up_trial_is_taken_and_is_no_success(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    true = true_trajectory(context, job)
    blown = replace(true, positions=changed(true.positions, lambda a: a[5:].fill(np.nan)))
    assert caller.outcome(lease, write_trajectory(blown)).json() == {"status": "done"}
    now = ended(context, job)
    assert (now.success, now.flags) == (False, ["unstable"])


def test_an_outcome_counts_once(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    data = write_trajectory(true_trajectory(context, job))
    first = caller.outcome(lease, data)
    assert first.json() == {"status": "done"}
    sent = {"sha256": "0" * 64, "size": 5}
    after = everything(context.store.database)
    body = {"trajectory": sent, "versions": VERSIONS, "wall_s": 5}
    for again in (body, {**body, "trajectory": None}):
        answer = caller.ask("POST", caller.at(lease, "/outcome"), json=again)
        assert answer.json() == {"status": "already_done"}
    for path, more in (
        ("/fault", {"json": {"reason": "simulator_fault", "detail": "b", "permanent": True}}),
        ("/hand-back", {}),
    ):
        assert caller.ask("POST", caller.at(lease, path), **more).status_code == 409
    assert caller.ask("GET", caller.at(lease)).status_code == 409
    upload = caller.at(lease, f"/uploads/{'0' * 64}")
    put = caller.ask("PUT", upload, params={"size": 4, "offset": 0}, content=b"text")
    assert put.status_code == 409
    assert everything(context.store.database) == after
    ended(context, job)


def test_faults_and_hand_backs_count_once(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    fault = {"reason": "simulator_fault", "detail": "it hangs"}
    for status in ("done", "already_done"):
        answer = caller.ask("POST", caller.at(lease, "/fault"), json=fault)
        assert answer.json() == {"status": status}
    assert context.store.jobs.get(job.id).faults == 1
    pause_ends(context)
    lease = caller.lease()
    for status in ("done", "already_done"):
        assert caller.ask("POST", caller.at(lease, "/hand-back")).json() == {"status": status}
    now = context.store.jobs.get(job.id)
    assert (now.state, now.faults) == ("queued", 1)
    assert [a.result for a in context.store.jobs.attempts(job.id)] == ["fault", "handed_back"]


def test_stale_tokens_are_refused(context, url, caller) -> None:
    job = waiting(context)
    old = caller.lease()
    data = write_trajectory(true_trajectory(context, job))
    sent = caller.upload(old, data)
    expire_leases(context)
    context.store.leases.recover()
    pause_ends(context)
    new = Caller(url, caller.secret, name="another").lease()
    assert new["token"] == old["token"] + 1
    before = everything(context.store.database)
    body = {"trajectory": sent, "versions": VERSIONS, "wall_s": 5}
    for token in (old["token"], new["token"] + 1, old["token"] - 1 or 2**40, 2**62):
        named = {**old, "token": token}
        answer = caller.ask("POST", caller.at(named, "/outcome"), json=body)
        assert answer.status_code == 409, (token, answer.text)
    for token in ("0", "-1", "1.5", "x", str(2**64)):
        named = {**old, "token": token}
        answer = caller.ask("POST", caller.at(named, "/outcome"), json=body)
        assert answer.status_code == 404, (token, answer.text)
    elsewhere = {**new, "job_id": "job_00000000000000000000"}
    assert caller.ask("GET", caller.at(elsewhere)).status_code == 409
    # What was uploaded under the old lease is not there under the new one.
    answer = caller.ask("POST", caller.at(new, "/outcome"), json=body)
    assert answer.status_code == 422
    assert "0 of" in answer.text
    assert everything(context.store.database) == before
    assert caller.outcome(new, data).json() == {"status": "done"}


def test_a_store_that_fails_costs_no_outcome(context, caller, monkeypatch) -> None:
    job = waiting(context)
    lease = caller.lease()
    data = write_trajectory(true_trajectory(context, job))
    sent = caller.upload(lease, data)
    body = {"trajectory": sent, "versions": VERSIONS, "wall_s": 5}

    def full(*_: object) -> None:
        raise ArtifactStoreError("no space left")

    with monkeypatch.context() as patched:
        patched.setattr("buildarena_store.artifacts.ArtifactStore.put", full)
        answer = caller.ask("POST", caller.at(lease, "/outcome"), json=body)
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
    assert caller.ask("POST", caller.at(lease, "/outcome"), json=body).is_success
    ended(context, job)
