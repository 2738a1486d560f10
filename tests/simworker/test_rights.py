"""A runner key may lease trials and nothing else, nobody else may, and it harms only itself."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import pytest
from schemathesis import GenerationMode
from support.clients.tenants import ADMIN, WITH_KEYS, everything
from support.contract import contract
from support.jobs import execute, expire_leases
from support.servers.contract import SCHEMA, ask, ways
from support.servers.live_api import live_api
from support.servers.runner_rig import (
    Caller,
    as_admin,
    pause_ends,
    runner_key,
    true_trajectory,
    waiting,
)
from support.servers.stacks import wait_until

from buildarena_api.contract import operations
from buildarena_api.runners import lease_queue
from buildarena_simulation import SIMULATION_VERSION, write_trajectory

WAYS = [(m.upper(), path) for path, methods in contract()["paths"].items() for m in methods]
OURS = [(method, path) for method, path in WAYS if path.startswith("/v1/runner")]
OTHERS = [way for way in WAYS if way not in OURS and way[1] != "/v1/health"]
FAULT = {"reason": "simulator_fault", "detail": "it hangs"}
NEVER = {**FAULT, "permanent": True}


@pytest.fixture
def callers(context, url) -> list[Caller]:
    """Three with keys of their own."""
    return [Caller(url, runner_key(context)[1]) for _ in range(3)]


@pytest.fixture
def caller(callers) -> Caller:
    return callers[0]


def offered(caller: Caller, **about: Any) -> bool:
    answer = caller.ask("POST", "/leases", json={**caller.about(), **about})
    assert answer.status_code in {200, 204}, answer.text
    return answer.status_code == 200


@pytest.mark.ci
def test_a_runner_key_reaches_no_other_route(caller) -> None:
    assert len(OTHERS) > 40
    asked = {way: caller.ask(way[0], "/.." + way[1].removeprefix("/v1")) for way in OTHERS}
    assert [way for way, answer in asked.items() if answer.status_code != 403] == []


def test_each_operation_needs_the_scope_that_the_table_names(context, url) -> None:
    less = {
        "runner": Caller(url, context.store.keys.create(name="a", scopes=["submit"])[1]),
        "admin": Caller(url, context.store.keys.create(name="b", scopes=["submit"])[1]),
        "submit": Caller(url, context.store.keys.create(name="c", scopes=["read"])[1]),
        "read": Caller(url, runner_key(context)[1]),
    }
    table = operations()
    assert len(table) == len(WAYS)
    for method, path, name, scope in table:
        place = "/.." + path.removeprefix("/v1")
        without = Caller(url).ask(method, place).status_code
        assert (without == 401) == (scope != "none"), name
        if scope != "none":
            assert less[scope].ask(method, place).status_code == 403, name


def test_no_other_key_is_a_runners_and_only_admins_make_such_keys(context, url) -> None:
    def statuses(caller: Caller) -> set[int]:
        named = {"job_id": "job_0", "token": "1", "sha256": "0" * 64, "name": "w"}
        asked = [(method, path.removeprefix("/v1/runner").format(**named)) for method, path in OURS]
        return {caller.ask(*way, json={}).status_code for way in asked}

    assert len(OURS) >= 8
    body = {"name": "k", "scopes": ["runner"], "simulators": ["mujoco"]}
    submits = Caller(url, context.store.keys.create(name="a", scopes=["submit"])[1])
    assert statuses(submits) == statuses(as_admin(url)) == {403}
    assert statuses(Caller(url)) == {401}
    assert submits.ask("POST", "/../keys", json=body).status_code == 403
    made = as_admin(url).ask("POST", "/../keys", json=body)
    assert made.status_code == 201
    assert Caller(url, made.json()["secret"]).ask("GET", "").json()["simulators"] == ["mujoco"]
    for wrong, says in [
        ({"simulators": None}, "names its simulators"),
        ({"scopes": ["admin", "runner"]}, "must be alone"),
        ({"simulators": []}, "at least 1"),
        ({"simulators": ["unity"]}, "unknown simulator 'unity'"),
        ({"job_owners": ["ada"]}, "pattern"),
        ({"budget": {"max_requests": 1}}, "no budget"),
        ({"scopes": ["submit"]}, "scope runner"),
    ]:
        answer = Caller(url, ADMIN).ask("POST", "/../keys", json=body | wrong)
        assert (answer.status_code, says in answer.text) == (422, True), answer.text


def test_only_trials_of_its_simulators_and_versions_are_leased(context, url, caller) -> None:
    waiting(context)
    other = Caller(url, runner_key(context, "pybullet")[1])
    both = dict.fromkeys(("pybullet", "mujoco"), SIMULATION_VERSION)
    for simulators in (other.about()["simulators"], {"unity": "3"}, both):
        refused = other.ask("POST", "/leases", json={**other.about(), "simulators": simulators})
        assert (refused.status_code, "choose from pybullet" in refused.text) == (403, True)
    assert other.ask("POST", "/heartbeat", json=other.about()).status_code == 403
    assert not offered(other, simulators={"pybullet": SIMULATION_VERSION})
    for faults in (0, 1):  # nor when it comes first
        execute(context, "UPDATE jobs SET faults = :faults", {"faults": faults})
        for version in ("2", f"{SIMULATION_VERSION}.0", SIMULATION_VERSION * 2, "999"):
            assert not offered(caller, simulators={"mujoco": version}), version
    assert caller.lease()["version"] == SIMULATION_VERSION


def test_a_key_for_ones_own_jobs_leases_no_others(context, url, caller) -> None:
    ada, bob = (context.store.keys.create(name=n, scopes=["submit"])[0].id for n in ("ada", "bob"))
    theirs = waiting(context, seed=0, owner=bob)
    nobodys = waiting(context, seed=1)
    own = waiting(context, seed=2, owner=ada)
    execute(context, "UPDATE jobs SET faults = 1 WHERE id = :id", {"id": theirs.id})
    of_ada = Caller(url, runner_key(context, job_owners=[ada])[1])
    assert of_ada.lease()["job_id"] == own.id
    of_ada.name = "second"
    assert not offered(of_ada)
    found = {caller.lease()["job_id"]}
    caller.name = "second"
    assert found | {caller.lease()["job_id"]} == {theirs.id, nobodys.id}


def test_another_keys_lease_can_not_be_written(context, callers) -> None:
    job = waiting(context)
    holder, thief, _ = callers
    lease = holder.lease()
    data = write_trajectory(true_trajectory(context, job))
    sent = holder.upload(lease, data)
    before = everything(context.store.database)
    outcome = {"trajectory": sent, "versions": {}, "wall_s": 1}
    for method, path, options in (
        ("PUT", f"/uploads/{sent}", {"content": data}),
        ("POST", "/outcome", {"json": outcome}),
        ("POST", "/fault", {"json": NEVER}),
        ("POST", "/release", {}),
    ):
        answer = thief.ask(method, thief.at(lease, path), **options)
        assert answer.status_code == 409, (method, path, answer.text)
        assert "mujoco" not in answer.text
    named = thief.named(lease)
    beat = thief.ask("POST", "/heartbeat", json=thief.about(leases=[named]))
    assert beat.json() == {"live": [], "lost": [named]}
    assert everything(context.store.database) == before
    assert holder.outcome(lease, data).json() == {"status": "done"}


def test_a_job_that_a_worker_beside_the_database_has_is_not_a_runners(context, caller) -> None:
    job = waiting(context)
    lease = context.store.leases.claim("simulate.mujoco", owner="simulate@here:1")
    named = {"job_id": job.id, "token": lease.token}
    assert caller.ask("POST", caller.at(named, "/release")).status_code == 409


def test_one_name_has_one_lease(context, callers) -> None:
    for seed in range(3):
        waiting(context, seed=seed)
    caller, other, _ = callers  # another key's runner has the same name
    first = caller.lease()
    assert caller.lease() == first
    caller.name = "by-hand.1"  # begins like the first
    assert len({each["job_id"] for each in (first, caller.lease(), other.lease())}) == 3


def test_a_keys_leases_are_bounded_as_they_are_given(context, url, callers, monkeypatch) -> None:
    monkeypatch.setattr(lease_queue, "MAX_LEASES", 5)
    for seed in range(9):
        waiting(context, seed=seed)

    def lease(number: int) -> int:
        one = Caller(url, callers[0].secret, name=f"r{number}")
        return one.ask("POST", "/leases", json=one.about(wait_s=5)).status_code

    with ThreadPoolExecutor(8) as at_once:
        assert sorted(at_once.map(lease, range(8))) == [200] * 5 + [429] * 3
    callers[1].lease()  # another key has its own


def test_no_lease_is_renewed_forever(context, caller) -> None:
    waiting(context)
    named = caller.named(caller.lease())
    beat = caller.about(leases=[named])
    assert caller.ask("POST", "/heartbeat", json=beat).json()["live"] == [named]
    execute(context, "UPDATE attempts SET started_at = now() - interval '61 minutes'")
    assert caller.ask("POST", "/heartbeat", json=beat).json()["lost"] == [named]


def test_runners_are_workers_like_others(url, caller) -> None:
    caller.ask("POST", "/heartbeat", json=caller.about(versions={"engine": "mujoco"}, pid=7))
    admin = as_admin(url)
    (listed,) = admin.ask("GET", "/../workers").json()["data"]
    assert (listed["queues"], listed["pid"], listed["alive"]) == (["simulate.mujoco"], 7, True)
    assert listed["id"].startswith("runner@key_")

    def is_served() -> bool:
        checks = admin.ask("GET", "/../health").json()["checks"]
        return {c["name"]: c["ok"] for c in checks}["workers of simulate.mujoco"]

    wait_until(is_served, 20, "health was told")
    assert caller.ask("DELETE", f"/workers/{caller.about()['name']}").status_code == 204
    assert admin.ask("GET", "/../workers").json()["data"] == []


def misses(context, caller: Caller, how: str) -> None:
    lease = caller.lease()
    if how == "lost":
        expire_leases(context)
        context.store.leases.recover()
        return
    body = {"fault": FAULT, "never": NEVER}.get(how)
    path = "/release" if body is None else "/fault"
    assert caller.ask("POST", caller.at(lease, path), json=body).status_code == 200


def test_a_key_that_misses_a_trial_again_and_again_counts_once(context, callers) -> None:
    job = waiting(context)
    for how in ("fault", "hand back", "lost", "fault"):
        misses(context, callers[0], how)
        assert not offered(callers[0], name="another-name"), f"it waits after: {how}"
        pause_ends(context)
    now = context.store.jobs.get(job.id)
    assert (now.state, now.faults) == ("queued", 1)
    misses(context, callers[0], "fault")
    assert offered(callers[1]), "who did not miss it need not wait"


@pytest.mark.ci
def test_the_pause_grows(context, caller) -> None:
    waiting(context)
    ended = "UPDATE attempts SET ended_at = now() - make_interval(secs => :s)"
    for pause_s in (2, 4, 8, 16, 32):
        misses(context, caller, "fault")
        execute(context, ended, {"s": pause_s * 3 // 4})
        assert not offered(caller), pause_s
        execute(context, ended, {"s": pause_s + 1})


def test_what_can_not_be_done_needs_two_keys_or_a_worker_of_the_house(context, callers) -> None:
    job = waiting(context)
    misses(context, callers[0], "never")
    pause_ends(context)
    assert not offered(callers[0])
    now = context.store.jobs.get(job.id)
    assert (now.state, "another key" in now.detail) == ("queued", True)
    misses(context, callers[1], "fault")
    assert context.store.jobs.get(job.id).state == "queued"
    misses(context, callers[2], "never")
    now = context.store.jobs.get(job.id)
    assert (now.state, now.outcome, now.reason) == ("done", "errored", "simulator_fault")
    other = waiting(context, seed=1)
    misses(context, callers[0], "never")
    lease = context.store.leases.claim("simulate.mujoco", owner="simulate@here:1")
    assert lease.job.id == other.id
    context.store.leases.give_up(lease, "so it is", reason="game_version")
    assert context.store.jobs.get(other.id).outcome == "errored"


def test_evidence_of_faults_is_bounded_and_only_the_latest_stays(context, callers) -> None:
    job = waiting(context)
    lease = callers[0].lease()
    hash_ = callers[0].upload(lease, bytes(17 << 20))
    large = {"files": [{"name": "log-0-0.txt", "sha256": hash_}]}
    for wrong, says in ((large, f"{16 << 20:,}"), ({"reason": "because"}, "simulator_fault")):
        at = callers[0].at(lease, "/fault")
        refused = callers[0].ask("POST", at, json={**FAULT, **wrong})
        assert (refused.status_code, says in refused.text) == (422, True)
    for number, caller in enumerate(callers):
        lease = caller.lease()
        sent = {"sha256": caller.upload(lease, b"log"), "name": f"log-0-{number}.txt"}
        body = {**FAULT, "files": [sent]}
        assert caller.ask("POST", caller.at(lease, "/fault"), json=body).status_code == 200
    logs = [name for name in context.store.jobs.artifacts(job.id) if "log" in name]
    assert logs == ["log-0-2.txt"]


@pytest.mark.ci
def test_every_answer_to_odd_requests_is_a_documented_one(context) -> None:
    own = context.settings.model_copy(update={**WITH_KEYS, "require_keys": False, "lease_s": 60.0})
    with live_api(replace(context, settings=own)) as url:
        for number, way in enumerate(ways(SCHEMA.include(path_regex="^/v1/runner"))):
            waiting(context, seed=number)
            lease = Caller(url, name=f"slot-{number}").lease()

            def prepare(case: Any, way: Any = way, lease: Any = lease) -> None:
                # Half of what is worth asking needs a lease that lives.
                for name in ("job_id", "token"):
                    if way[1] is GenerationMode.POSITIVE and name in (case.path_parameters or {}):
                        case.path_parameters[name] = lease[name]
                if isinstance(case.body, dict) and "wait_s" in case.body:
                    case.body["wait_s"] = 0

            ask(url, way, 2, prepare)
