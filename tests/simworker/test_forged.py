"""Nothing that a runner sends is believed: forged, stale and repeated outcomes change nothing."""

import io
import json
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.clients.tenants import everything
from support.game.game_rig import trial_of
from support.jobs import expire_leases
from support.machines.piloted import experts_machine
from support.servers.runner_rig import (
    CARRY,
    VERSIONS,
    Caller,
    ended,
    pause_ends,
    true_trajectory,
    waiting,
)

from buildarena_backend.errors import ArtifactStoreError, UploadError
from buildarena_backend.trials.trial_checks import checked_trajectory, require_decided
from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import SIMULATION_VERSION, Trajectory, simulate, write_trajectory
from buildarena_simworker.engines import EngineSimulator

Forgery = Callable[[Trajectory], Trajectory]
LONG = "x" * 500
LANDING = builtin_tasks()["landing-2"]
SEED = 7


def put(array: np.ndarray, at: object, value: object) -> np.ndarray:
    made = array.copy()
    made[at] = value
    return made


def having(**settings: object) -> Forgery:
    return lambda t: replace(t, settings={**t.settings, **settings})


def with_facts(
    data: bytes, facts: object = None, *, change: Callable = lambda t: t, **how
) -> bytes:
    """The file with other facts, rows or format, as no writer of ours would write it."""
    table = change(pq.read_table(io.BytesIO(data)))
    kept = json.loads(table.schema.metadata[b"buildarena.trajectory"])
    facts = {**kept, **facts} if facts else kept
    out = io.BytesIO()
    told = {b"buildarena.trajectory": json.dumps(facts).encode()}
    options = {"compression": "zstd", "use_dictionary": False, **how}
    pq.write_table(table.replace_schema_metadata(told), out, **options)
    return out.getvalue()


def with_column(name: str, values: Callable[[int], list]) -> Callable[[bytes], bytes]:
    def change(table: pa.Table) -> pa.Table:
        return table.drop_columns([name]).append_column(name, pa.array(values(len(table))))

    return lambda data: with_facts(data, change=change)


def part_of(whole: Any, count: int) -> Any:
    """The first samples of a trajectory, or of one of its records."""
    length = len(whole.time_s) if isinstance(whole, Trajectory) else None
    parts = {}
    for field in fields(whole):
        value = getattr(whole, field.name)
        if field.name in ("bearing", "piloting") and value is not None:
            parts[field.name] = part_of(value, count)
        elif isinstance(value, np.ndarray) and (length is None or len(value) == length):
            parts[field.name] = value[:count]
    return replace(whole, **parts)


OTHERS: dict[str, Forgery] = {
    "blocks of another machine": lambda t: replace(t, block_ids=("1", "3")),
    "blocks in another order": lambda t: replace(t, block_ids=t.block_ids[::-1]),
    "one block twice": lambda t: replace(t, block_ids=("1", "1")),
    "another time base": lambda t: replace(t, time_s=t.time_s * 2),
    "cut off": lambda t: part_of(t, len(t.time_s) - 1),
    "a start a little higher": lambda t: replace(t, positions=t.positions + np.float32(0.01)),
    "a hole in the middle": lambda t: replace(t, positions=put(t.positions, 3, np.nan)),
    "infinity between figures": lambda t: replace(t, quaternions=put(t.quaternions, 2, np.inf)),
    "loads that are no figures": lambda t: replace(t, joint_loads=put(t.joint_loads, ..., np.nan)),
    "another engine": lambda t: replace(t, engine="pybullet"),
    "another version": lambda t: replace(t, simulation_version="2"),
    "an engine that manifests do not have": lambda t: replace(t, engine_version="0.0.1"),
    "another scenario": having(scenario="0" * 16),
    "another key pressed": having(presses='[["UpArrow",0.0,1.0]]'),
    "no scenario": lambda t: replace(t, settings={}),
    "a varied start": having(seed=1),
    "a setting without end": having(note=LONG),
    "a setting that is no figure": having(gravity=float("inf")),
    "joints of another machine": lambda t: replace(
        t, joint_peaks=(), joint_loads=t.joint_loads[:, :0]
    ),
    "no pieces": lambda t: replace(t, pieces=None),
    "pieces of others": lambda t: replace(t, pieces=put(t.pieces, ..., 99)),
    "no bearing": lambda t: replace(t, bearing=None),
    "cannons that it has not": lambda t: replace(
        t, cannon_ids=("2",), heated=np.zeros((len(t.time_s), 1), dtype=bool)
    ),
    "a heavier cargo": lambda t: replace(t, cargo_mass=t.cargo_mass * 2),
    "a smaller cargo": lambda t: replace(t, cargo_size=(0.1, 0.1, 0.1)),
    "a cargo elsewhere": lambda t: replace(t, cargo_position=t.cargo_position + np.float32(1)),
    "no cargo": lambda t: replace(
        t, cargo_position=None, cargo_quaternion=None, cargo_mass=None, cargo_size=None
    ),
}
FILES: dict[str, Callable[[bytes], bytes]] = {
    "nothing": lambda _: b"",
    "no Parquet": lambda _: b"PAR1 no, not really PAR1",
    "half a file": lambda data: data[: len(data) // 2],
    "bytes changed in the middle": lambda data: data[:200] + bytes(200) + data[400:],
    "an older schema": lambda data: with_facts(data, {"schema_version": 2}),
    "a schema to come": lambda data: with_facts(data, {"schema_version": 99}),
    "a schema that is no number": lambda data: with_facts(data, {"schema_version": "3x"}),
    "an unknown fact": lambda data: with_facts(data, {"success": True}),
    "peaks of another shape": lambda data: with_facts(data, {"joint_peaks": [{"joint": 1}]}),
    "ids that are no texts": lambda data: with_facts(data, {"block_ids": [1, 2]}),
    "settings that are none": lambda data: with_facts(data, {"settings": [1]}),
    "a column less": lambda d: with_facts(d, change=lambda t: t.drop_columns(["positions"])),
    "a column of texts": with_column("positions", lambda rows: [["a"] * 6] * rows),
    "rows of different lengths": with_column(
        "quaternions", lambda rows: [[1.0] * n for n in range(rows)]
    ),
    "fewer instants": lambda data: with_facts(data, change=lambda t: t.slice(0, 5)),
    "several row groups": lambda data: with_facts(data, row_group_size=4),
    "a dictionary": lambda data: with_facts(data, use_dictionary=True),
    "far too much": lambda d: with_facts(
        d, change=lambda t: t.append_column("heated", pa.array([np.zeros(40_000)] * len(t)))
    ),
}
SAID = (
    *({"versions": {}}, {"versions": {**VERSIONS, "engine": "pybullet"}}),
    *(
        {"versions": {**VERSIONS, "simulation": "999"}},
        {"versions": {f"k{n}": 1 for n in range(99)}},
    ),
    *(
        {"versions": {**VERSIONS, "engine_version": "1"}},
        {"versions": {**VERSIONS, "n": LONG * 10}},
    ),
    {"versions": {**VERSIONS, "deep": {"a": {"b": {"c": 1}}}}},
    *({"score": {"success": True}}, {"success": True, "indicator": 1e9}),
    *({"wall_s": -1}, {"wall_s": 1e9}, {"wall_s": "NaN"}),
)
"""What is said beside a true trajectory, and wrong."""


@pytest.mark.ci
def test_what_is_no_trial_of_the_job_is_refused_and_changes_nothing(context, caller) -> None:
    job = waiting(context, CARRY)
    lease = caller.lease()
    true = true_trajectory(context, job)
    data = write_trajectory(true)
    tries: dict[str, tuple[bytes | None, dict]] = {"no trajectory": (None, {})}
    tries |= {name: (write_trajectory(make(true)), {}) for name, make in OTHERS.items()}
    tries |= {name: (make(data), {}) for name, make in FILES.items()}
    tries |= {str(said): (data, said) for said in SAID}
    verdict = {"success": True, "indicator": 1.0, "flags": [], "engine_version": "1"}
    for engine in ("mujoco", "unity"):
        told = {engine: {**verdict, "simulation": SIMULATION_VERSION}}
        tries[f"annotations of {engine}"] = data, {"annotations": told}
    answers: dict[str, str] = {}
    for name, (sent, more) in tries.items():
        beat = caller.ask("POST", "/heartbeat", json=caller.about(leases=[caller.named(lease)]))
        assert len(beat.json()["live"]) == 1
        before = everything(context.store.database)
        answer = caller.outcome(lease, sent, **more)
        assert answer.status_code == 422, (name, answer.text)
        assert everything(context.store.database) == before, name
        answers[name] = answer.text
    assert "does not refuse this machine" in answers["no trajectory"]
    assert "another mass" in answers["a heavier cargo"]
    assert "starts at another place" in answers["a start a little higher"]
    # What it really came to is taken all the same.
    assert caller.outcome(lease, data).json() == {"status": "done"}
    ended(context, job)


NAMES = [
    *("machine", "trajectory-0", "transcript", "log-1.txt", "log-00.txt", "log-0.TXT"),
    *("../log-0.txt", "log-0.txt/../../x", "/etc/log-0.txt", "log-0\\x.txt", "log-0.txt\n"),
    *("log-0.html", "log-0.svg", "log-0", "page-0.txt", "log-0.txt\x00", "lög-0.txt", ""),
]


def test_files_have_names_of_this_trial_and_come_once(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    data = write_trajectory(true_trajectory(context, job))
    sha256 = caller.upload(lease, b"text")
    many = [f"screenshot-0-{number}.png" for number in range(20)]
    for names in (*([name] for name in NAMES), ["log-0.txt"] * 2, many):
        files = [{"name": name, "sha256": sha256} for name in names]
        assert caller.outcome(lease, data, files=files).status_code == 422, names
    assert context.store.jobs.artifacts(job.id).keys() == {"machine"}
    # What was uploaded for an outcome that was refused is gone.
    files = [{"name": "log-0.txt", "sha256": caller.upload(lease, b"text")}]
    assert caller.outcome(lease, data, files=files).status_code == 200


def test_a_blown_up_trial_is_taken_and_is_no_success(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    true = true_trajectory(context, job)
    blown = replace(true, positions=put(true.positions, slice(5, None), np.nan))
    assert caller.outcome(lease, write_trajectory(blown)).json() == {"status": "done"}
    now = ended(context, job)
    assert (now.success, now.flags) == (False, ["unstable"])


def test_an_outcome_counts_once(context, caller) -> None:
    job = waiting(context)
    lease = caller.lease()
    data = write_trajectory(true_trajectory(context, job))
    assert caller.outcome(lease, data).json() == {"status": "done"}
    after = everything(context.store.database)
    body = {"trajectory": "0" * 64, "versions": VERSIONS, "wall_s": 5}
    for again in (body, {**body, "trajectory": None}):
        answer = caller.ask("POST", caller.at(lease, "/outcome"), json=again)
        assert answer.json() == {"status": "already_done"}
    fault = {"reason": "simulator_fault", "detail": "b", "permanent": True}
    for method, path, more in (
        ("POST", "/fault", {"json": fault}),
        ("POST", "/release", {}),
        ("PUT", f"/uploads/{'0' * 64}", {"content": b"text"}),
    ):
        assert caller.ask(method, caller.at(lease, path), **more).status_code == 409, path
    assert everything(context.store.database) == after


def test_faults_and_hand_backs_count_once(context, caller) -> None:
    job = waiting(context)
    fault = {"reason": "simulator_fault", "detail": "it hangs"}
    for path, body in (("/fault", fault), ("/release", None)):
        lease = caller.lease()
        for status in ("done", "already_done"):
            answer = caller.ask("POST", caller.at(lease, path), json=body)
            assert answer.json() == {"status": status}
        assert context.store.jobs.get(job.id).faults == 1
        pause_ends(context)
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
    stale, malformed = (old["token"], new["token"] + 1, 2**62), ("0", "-1", "1.5", "x", str(2**64))
    for token in (*stale, *malformed):
        answer = caller.ask("POST", caller.at({**old, "token": token}, "/outcome"), json=body)
        assert answer.status_code == (409 if token in stale else 404), (token, answer.text)
    elsewhere = {**new, "job_id": "job_00000000000000000000"}
    assert caller.ask("POST", caller.at(elsewhere, "/release")).status_code == 409
    # What was uploaded under the old lease is not there under the new one.
    answer = caller.ask("POST", caller.at(new, "/outcome"), json=body)
    assert (answer.status_code, "was not uploaded" in answer.text) == (422, True)
    assert everything(context.store.database) == before
    assert caller.outcome(new, data).json() == {"status": "done"}


def test_a_store_that_fails_costs_no_outcome(context, caller, monkeypatch) -> None:
    job = waiting(context)
    lease = caller.lease()
    sent = caller.upload(lease, write_trajectory(true_trajectory(context, job)))
    body = {"trajectory": sent, "versions": VERSIONS, "wall_s": 5}

    def full(*_: object) -> None:
        raise ArtifactStoreError("no space left")

    with monkeypatch.context() as patched:
        patched.setattr("buildarena_backend.artifacts.store.ArtifactStore.put", full)
        answer = caller.ask("POST", caller.at(lease, "/outcome"), json=body)
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
    assert caller.ask("POST", caller.at(lease, "/outcome"), json=body).is_success
    ended(context, job)


@pytest.fixture(scope="module")
def pilot() -> Machine:
    return experts_machine(LANDING)


@pytest.fixture(scope="module")
def honest(pilot) -> Trajectory:
    return simulate(pilot, LANDING.scenario, "mujoco", seed=SEED)


def checked(told: Trajectory, machine: Machine, seed: int | None = SEED) -> Trajectory:
    given = {"machine": machine, "scenario": LANDING.scenario, "seed": seed}
    made = {"simulator": "mujoco", "version": SIMULATION_VERSION}
    return checked_trajectory(write_trajectory(told), **made, **given)


def test_a_varied_world_is_simulated_by_its_seed(pilot, honest) -> None:
    request = trial_of(LANDING, pilot, version=SIMULATION_VERSION, seed=SEED)
    told = EngineSimulator("mujoco").run(request).trajectory
    assert write_trajectory(told) == write_trajectory(honest)


def test_a_trial_is_as_long_as_it_takes_to_decide_it(honest) -> None:
    require_decided(honest, LANDING, seed=SEED)
    with pytest.raises(UploadError, match="when it is decided"):
        require_decided(part_of(honest, len(honest.time_s) - 1), LANDING, seed=SEED)


def piloting(**changes: Callable) -> Forgery:
    """A forgery of what was sensed and asked for."""

    def forged(trajectory: Trajectory) -> Trajectory:
        told = trajectory.piloting
        made = {name: change(getattr(told, name)) for name, change in changes.items()}
        return replace(trajectory, piloting=replace(told, **made))

    return forged


PILOTED: list[tuple[Forgery, str]] = [
    (lambda t: replace(t, piloting=None), "schema is '3', not 4"),
    (piloting(answers=lambda a: put(a, (3, 0), 1.5)), "an answer is not from 0 to 1"),
    (piloting(answers=lambda a: put(a, (3, 0), -0.1)), "an answer is not from 0 to 1"),
    (piloting(answers=lambda a: put(a, (3, 0), np.nan)), "an answer is not from 0 to 1"),
    (piloting(senses=lambda a: a.astype(np.float64)), "senses is not of type float32"),
    (piloting(sense_names=lambda n: (n[1], *n[1:])), "comes twice"),
    (piloting(action_names=lambda n: (n[1], *n[1:])), "comes twice"),
    (piloting(sense_names=lambda n: ("x" * 500, *n[1:])), "or a long one"),
    (
        piloting(
            senses=lambda a: np.tile(a, (1, 500)),
            sense_names=lambda n: tuple(f"{k}" for k in range(500 * len(n))),
        ),
        "a trajectory of this machine has fewer",
    ),
    (having(controller="0" * 64), "controller"),
    (having(seed=8), "settings.seed"),
]


def test_what_is_said_of_a_program_is_bounded_and_sound(honest, pilot, subtests) -> None:
    again = checked(honest, pilot)
    assert np.array_equal(again.piloting.answers, honest.piloting.answers)
    for number, (forge, says) in enumerate(PILOTED):
        with subtests.test(number), pytest.raises(UploadError) as caught:
            checked(forge(honest), pilot)
        assert says in str(caught.value)


@pytest.mark.ci
def test_a_trial_in_an_easier_world_or_by_keys_is_not_that_of_the_seed(pilot, honest) -> None:
    """The world of another seed, said to be this one's: it starts elsewhere."""
    for seed in (None, 8):
        other = simulate(pilot, LANDING.scenario, "mujoco", seed=seed)
        with pytest.raises(UploadError, match="start"):
            checked(having(seed=SEED)(other), pilot)
    with pytest.raises(UploadError, match=r"settings\.seed"):
        checked(honest, pilot, seed=None)
    by_keys = pilot.with_controller("")
    keys = simulate(by_keys, LANDING.scenario, "mujoco", seed=SEED)
    assert checked(keys, by_keys).piloting is None
    with pytest.raises(UploadError, match="schema is '4', not 3"):
        checked(replace(keys, piloting=honest.piloting), by_keys)
