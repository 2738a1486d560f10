"""A runner key may lease trials and nothing else, and nobody else may do that."""

import pytest
from sqlalchemy import text
from support.clients.tenants import ADMIN, everything
from support.contract import contract
from support.servers.runner_rig import Caller, as_admin, runner_key, true_trajectory, waiting
from support.servers.stacks import wait_until

from buildarena_api.runners import lease_queue
from buildarena_simulation import SIMULATION_VERSION, write_trajectory

CONTRACT = contract()
OTHERS = [
    (method.upper(), path)
    for path, methods in CONTRACT["paths"].items()
    for method in methods
    if not path.startswith("/v1/runner") and path != "/v1/health"
]
OURS = [
    (method.upper(), path)
    for path, methods in CONTRACT["paths"].items()
    for method in methods
    if path.startswith("/v1/runner")
]


def filled(path: str) -> str:
    for name, value in {"{job_id}": "job_0", "{token}": "1", "{sha256}": "0" * 64}.items():
        path = path.replace(name, value)
    return path.removeprefix("/v1/runner")


@pytest.mark.ci
def test_a_runner_key_reaches_no_other_route(context, url) -> None:
    assert len(OTHERS) > 40
    caller = Caller(url, runner_key(context)[1])
    answers = {
        (method, path): caller.ask(method, "/.." + path.removeprefix("/v1")).status_code
        for method, path in OTHERS
    }
    assert set(answers.values()) == {403}, answers


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("scope", ["read", "submit", "admin", None])
def test_no_other_key_is_a_runners(context, url, scope) -> None:
    caller = as_admin(url)
    if scope is not None:
        caller = Caller(url, context.store.keys.create(name="a", scopes=[scope])[1])
    answers = {
        (method, path): caller.ask(method, filled(path), json={}).status_code
        for method, path in OURS
    }
    assert len(answers) >= 9
    assert set(answers.values()) == {403}, answers
    nobody = {Caller(url).ask(method, filled(path)).status_code for method, path in OURS}
    assert nobody == {401}


WRONG_KEYS = [
    ({"scopes": ["runner"]}, "names its simulators"),
    ({"scopes": ["runner", "read"], "simulators": ["mujoco"]}, "stands alone"),
    ({"scopes": ["admin", "runner"], "simulators": ["mujoco"]}, "stands alone"),
    ({"scopes": ["runner"], "simulators": []}, "at least 1"),
    ({"scopes": ["runner"], "simulators": ["unity"]}, "there is no simulator 'unity'"),
    ({"scopes": ["runner"], "simulators": ["mujoco"], "job_owners": ["ada"]}, "pattern"),
    (
        {"scopes": ["runner"], "simulators": ["mujoco"], "budget": {"max_requests": 1}},
        "no budget",
    ),
    ({"scopes": ["submit"], "simulators": ["mujoco"]}, "scope runner"),
]


def test_keys_of_two_kinds_are_not_made(url) -> None:
    for wrong, says in WRONG_KEYS:
        answer = Caller(url, ADMIN).ask("POST", "/../keys", json={"name": "k", **wrong})
        assert answer.status_code == 422, wrong
        assert says in answer.text


def test_only_admins_make_runner_keys(context, url) -> None:
    body = {"name": "k", "scopes": ["runner"], "simulators": ["mujoco"]}
    for scope in ("read", "submit"):
        key = context.store.keys.create(name="a", scopes=[scope])[1]
        assert Caller(url, key).ask("POST", "/../keys", json=body).status_code == 403
    made = as_admin(url).ask("POST", "/../keys", json=body)
    assert made.status_code == 201
    facts = Caller(url, made.json()["secret"]).ask("GET", "").json()
    assert facts["simulators"] == ["mujoco"]
    assert set(facts["versions"]) == {"mujoco"}


def test_a_revoked_key_writes_nothing_any_more(context, url) -> None:
    job = waiting(context)
    key_id, secret = runner_key(context)
    caller = Caller(url, secret)
    lease = caller.lease()
    sent = caller.upload(lease, write_trajectory(true_trajectory(context, job)))
    as_admin(url).ask("POST", f"/../keys/{key_id}/revoke")
    body = {"trajectory": sent, "versions": {}, "wall_s": 1}
    assert caller.ask("POST", caller.at(lease, "/outcome"), json=body).status_code == 401


def test_only_its_simulators_jobs_are_leased(context, url) -> None:
    waiting(context)
    caller = Caller(url, runner_key(context, "pybullet")[1])
    for route in ("/leases", "/heartbeat", "/goodbye"):
        asked = caller.about()
        refused = caller.ask("POST", route, json=asked)
        expected = 200 if route == "/goodbye" else 403
        assert refused.status_code == expected, route
    assert "choose from pybullet" in caller.ask("POST", "/leases", json=caller.about()).text
    unknown = {**caller.about(), "simulators": {"unity": "3"}}
    assert caller.ask("POST", "/leases", json=unknown).status_code == 403
    own = {**caller.about(), "simulators": {"pybullet": "3"}}
    assert caller.ask("POST", "/leases", json=own).status_code == 204
    both = dict.fromkeys(("pybullet", "mujoco"), SIMULATION_VERSION)
    asked = {**caller.about(), "simulators": both}
    assert caller.ask("POST", "/leases", json=asked).status_code == 403


def test_jobs_of_other_versions_are_not_leased(context, url) -> None:
    waiting(context)
    caller = Caller(url, runner_key(context)[1])
    for faults in (0, 1):  # nor when it comes first
        with context.store.database.transaction() as connection:
            connection.execute(text(f"UPDATE jobs SET faults = {faults}"))
        for version in ("2", f"{SIMULATION_VERSION}.0", SIMULATION_VERSION * 2, "999"):
            other = {**caller.about(), "simulators": {"mujoco": version}}
            assert caller.ask("POST", "/leases", json=other).status_code == 204
    assert caller.lease()["version"] == SIMULATION_VERSION


def test_a_key_for_ones_own_jobs_leases_no_others(context, url) -> None:
    ada, bob = (context.store.keys.create(name=n, scopes=["submit"])[0].id for n in ("ada", "bob"))
    theirs = waiting(context, seed=0, owner=bob)
    nobodys = waiting(context, seed=1)
    own = waiting(context, seed=2, owner=ada)
    with context.store.database.transaction() as connection:
        connection.execute(text(f"UPDATE jobs SET faults = 1 WHERE id = '{theirs.id}'"))
    caller = Caller(url, runner_key(context, job_owners=[ada])[1])
    assert caller.lease()["job_id"] == own.id
    caller.name = "second"
    assert caller.ask("POST", "/leases", json=caller.about()).status_code == 204
    anybodys = Caller(url, runner_key(context)[1])
    found = {anybodys.lease()["job_id"]}
    anybodys.name = "second"
    found.add(anybodys.lease()["job_id"])
    assert found == {theirs.id, nobodys.id}


def test_another_keys_lease_can_neither_be_read_nor_written(context, url) -> None:
    job = waiting(context)
    holder, thief = (Caller(url, runner_key(context)[1]) for _ in range(2))
    lease = holder.lease()
    data = write_trajectory(true_trajectory(context, job))
    sent = holder.upload(lease, data)
    before = everything(context.store.database)
    outcome = {"trajectory": sent, "versions": {}, "wall_s": 1}
    fault = {"reason": "simulator_fault", "detail": "b", "permanent": True}
    upload = f"/uploads/{sent['sha256']}"
    for method, path, options in (
        ("GET", "", {}),
        ("GET", upload, {"params": {"size": len(data)}}),
        ("PUT", upload, {"params": {"size": len(data), "offset": 0}, "content": data}),
        ("POST", "/outcome", {"json": outcome}),
        ("POST", "/fault", {"json": fault}),
        ("POST", "/hand-back", {}),
    ):
        answer = thief.ask(method, thief.at(lease, path), **options)
        assert answer.status_code == 409, (method, path, answer.text)
        assert "mujoco" not in answer.text
    named = {"job_id": lease["job_id"], "token": lease["token"]}
    beat = thief.ask("POST", "/heartbeat", json=thief.about(leases=[named]))
    assert beat.json() == {"live": [], "lost": [named]}
    assert everything(context.store.database) == before
    assert holder.outcome(lease, data).json() == {"status": "done"}


def test_a_job_that_a_worker_beside_the_database_has_is_not_a_runners(context, url) -> None:
    job = waiting(context)
    lease = context.store.leases.claim("simulate.mujoco", owner="simulate@here:1")
    caller = Caller(url, runner_key(context)[1])
    named = {"job_id": job.id, "token": lease.token}
    assert caller.ask("GET", caller.at(named)).status_code == 409
    assert caller.ask("POST", caller.at(named, "/hand-back")).status_code == 409


def test_one_name_has_one_lease(context, url) -> None:
    for seed in range(3):
        waiting(context, seed=seed)
    caller = Caller(url, runner_key(context)[1])
    first = caller.lease()
    assert caller.lease() == first
    caller.name = "by-hand.1"  # begins like the first
    second = caller.lease()
    assert second["job_id"] != first["job_id"]
    other = Caller(url, runner_key(context)[1])  # another key's runner of the same name
    assert other.lease()["job_id"] not in {first["job_id"], second["job_id"]}


def test_a_keys_leases_and_names_are_bounded(context, url, monkeypatch) -> None:
    monkeypatch.setattr(lease_queue, "MAX_LEASES", 2)
    for seed in range(3):
        waiting(context, seed=seed)
    caller = Caller(url, runner_key(context)[1])
    for number in range(2):
        caller.name = f"n{number}"
        caller.lease()
    caller.name = "n2"
    refused = caller.ask("POST", "/leases", json=caller.about())
    assert (refused.status_code, refused.headers["retry-after"]) == (429, "5")
    Caller(url, runner_key(context)[1]).lease()  # another key has its own


def test_no_lease_is_renewed_forever(context, url) -> None:
    waiting(context)
    caller = Caller(url, runner_key(context)[1])
    lease = caller.lease()
    named = {"job_id": lease["job_id"], "token": lease["token"]}
    beat = caller.about(leases=[named])
    assert caller.ask("POST", "/heartbeat", json=beat).json()["live"] == [named]
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE attempts SET started_at = now() - interval '61 minutes'"))
    assert caller.ask("POST", "/heartbeat", json=beat).json()["lost"] == [named]


def test_runners_are_workers_like_others(context, url) -> None:
    caller = Caller(url, runner_key(context)[1])
    versions = {"engine": "mujoco", "simulation": SIMULATION_VERSION}
    caller.ask("POST", "/heartbeat", json=caller.about(versions=versions, pid=7))
    (listed,) = as_admin(url).ask("GET", "/../workers").json()["workers"]
    assert (listed["queues"], listed["pid"], listed["alive"]) == (["simulate.mujoco"], 7, True)
    assert listed["id"].startswith("runner@key_")

    def is_served() -> bool:
        checks = as_admin(url).ask("GET", "/../health").json()["checks"]
        return {c["name"]: c["ok"] for c in checks}["workers of simulate.mujoco"]

    wait_until(is_served, 20, "health was told")
    caller.ask("POST", "/goodbye", json=caller.about())
    assert as_admin(url).ask("GET", "/../workers").json()["workers"] == []
