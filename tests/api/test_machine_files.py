"""Machines that come as files: looked at, checked, tried; hostile ones refused in words."""

import json
import zlib

import pytest
from support.clients.tenants import new_tenant
from support.machine_files import published_files
from support.machines.building import BLOCK, built

from buildarena_api.machine_uploads import MAX_BYTES
from buildarena_geometry import Machine
from buildarena_store.jobs import files

TRIAL = {"task": "support-1", "simulator": "mujoco"}


def bridge(length: int = 4) -> Machine:
    return built(*((str(n), "E" if n == 1 else "A", BLOCK) for n in range(1, length)))


def document(machine: Machine | None = None) -> bytes:
    return json.dumps((machine or bridge()).to_document()).encode()


def changed(**change: object) -> bytes:
    return json.dumps({**json.loads(document()), **change}).encode()


def check(api, data: bytes, **params: str):
    return api.post("/v1/machines/check", content=data, params=params)


def attempt(api, data: bytes, **params: object):
    return api.post("/v1/machines/trials", content=data, params={**TRIAL, **params})


@pytest.mark.ci
def test_a_document_is_looked_at(api) -> None:
    machine = bridge()
    seen = check(api, document(machine)).json()
    assert (seen["parts"], seen["faults"], seen["detached"]) == (4, [], [])
    assert seen["mass"] == pytest.approx(machine.mass)
    assert seen["bounds"] == machine.bounds.tolist()
    assert [block["id"] for block in seen["scene"]["blocks"]] == list(machine.blocks)
    assert seen["broken_rule"] is None


def test_a_file_of_the_game_is_looked_at(api) -> None:
    data = published_files()["single_1_support_hard"]
    seen = check(api, data).json()
    assert seen["parts"] > 3
    assert len(seen["scene"]["blocks"]) + len(seen["scene"]["connectors"]) == seen["parts"]


def test_a_broken_rule_of_a_task_is_named(api) -> None:
    assert "asks for 2" in check(api, document(), task="lift-3").json()["broken_rule"]
    assert check(api, document(), task="support-1").json()["broken_rule"] is None
    unknown = check(api, document(), task="support-9")
    assert unknown.status_code == 422
    assert "support-1" in unknown.json()["errors"][0]["choices"]


def overlapping() -> bytes:
    content = json.loads(document())
    content["blocks"][2]["position"] = content["blocks"][1]["position"]
    return json.dumps(content).encode()


def unknown_module() -> bytes:
    content = json.loads(document())
    content["blocks"][1]["module"] = "<img src=x onerror=alert(1)>"
    return json.dumps(content).encode()


HOSTILE = {
    "nothing": (b"", "neither a machine document"),
    "noise": (bytes(range(256)) * 40, "neither a machine document"),
    "a list": (b"[]", "neither a machine document"),
    "an action log": (b'[{"op": "start"}]', "neither a machine document"),
    "another document": (b'{"a": 1}', "neither a machine document"),
    "a GLB": (b"glTF\x02\x00\x00\x00", "shapes only"),
    "deep": (b'{"blocks": ' + b"[" * 100_000, "inside each other"),
    "deep, in strings": (b'{"blocks":' + b'[{"a":' * 80 + b"1" + b"}]" * 80 + b"}", "inside each"),
    "long number": (b'{"blocks": ' + b"9" * 9000 + b"}", "digits"),
    "overlapping": (overlapping(), "overlap"),
    "unknown module": (unknown_module(), "Small Wooden Block"),
    "not a number": (document().replace(b'"next_id": 5', b'"next_id": NaN'), "next_id"),
    "later version": (changed(version=99), "version"),
    "many blocks": (changed(blocks=[1] * 30_000), "at most"),
    "many machines": (changed(available={"a": {"blocks": [1] * 30_000}}), "at most"),
    "many presses": (changed(control_sequence=[1] * 30_000), "at most"),
    "entities": (
        b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "b">]><Machine>&b;</Machine>',
        "",
    ),
    "a bomb": (zlib.compress(b"0" * 1_000_000), "neither a machine document"),
    "a page": (b"<html><script>alert(1)</script></html>", ""),
}


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("ask", [check, attempt])
def test_hostile_files_are_refused_in_words(api, ask, name) -> None:
    data, says = HOSTILE[name]
    answer = ask(api, data)
    assert answer.status_code == 422, answer.text
    assert says in answer.json()["detail"]
    assert answer.json()["errors"]


def test_a_file_too_large_is_refused(api) -> None:
    answer = check(api, b" " * (MAX_BYTES + 1))
    assert answer.status_code == 413
    assert f"{MAX_BYTES:,}" in answer.json()["detail"]


def test_a_machine_is_tried_on_no_leaderboard(api, context) -> None:
    answer = attempt(api, document())
    assert answer.status_code == 202
    job = answer.json()
    assert (job["state"], job["stage"]) == ("queued", "simulate")
    assert job["model"].startswith("file/")
    assert api.get(f"/v1/jobs/{job['id']}/machine").status_code == 200
    assert api.get(f"/v1/jobs/{job['id']}/scene").json()["machine"] is not None
    assert context.queues.settle()
    # The reaper may have named it too.
    assert context.queues.waiting("simulate.mujoco") >= 1
    again = attempt(api, document())
    assert (again.status_code, again.json()["id"]) == (200, job["id"])
    assert attempt(api, document(), seed=1).json()["id"] != job["id"]
    assert attempt(api, document(bridge(3))).json()["id"] != job["id"]


def test_a_machine_that_breaks_a_rule_ends_at_once_and_stays_off_the_board(api) -> None:
    job = attempt(api, document(), task="lift-3").json()
    assert (job["state"], job["outcome"]) == ("done", "construction_failed")
    board = api.get("/v1/leaderboard").json()
    assert board["track"] is None
    assert board["tracks"] == []


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("field", "value"), [("task", "support-9"), ("simulator", "newton")])
def test_what_does_not_exist_is_named(api, field, value) -> None:
    answer = attempt(api, document(), **{field: value})
    assert answer.status_code == 422
    (issue,) = answer.json()["errors"]
    assert issue["field"] == field
    assert issue["choices"]


def test_trials_under_way_are_bounded_for_each_key(guarded, monkeypatch) -> None:
    monkeypatch.setattr(files, "MAX_OPEN", 2)
    mine, other = new_tenant(guarded, "mine"), new_tenant(guarded, "other")

    def code(tenant, seed: int) -> int:
        params = {**TRIAL, "seed": seed}
        answer = tenant.ask("POST", "/v1/machines/trials", content=document(), params=params)
        return answer.status_code

    # An equal one takes no place.
    assert [code(mine, seed) for seed in (0, 1, 0, 2)] == [202, 202, 200, 429]
    assert code(other, 7) == 202


@pytest.fixture
def tenants(guarded):
    return new_tenant(guarded, "mine"), new_tenant(guarded, "other")


def brought(tenant, seed: int = 0):
    params = {**TRIAL, "seed": seed}
    return tenant.ask("POST", "/v1/machines/trials", content=document(), params=params)


def test_who_cancels_leaves_what_another_wants(tenants) -> None:
    mine, other = tenants
    job = brought(mine).json()["id"]
    assert brought(other).json()["id"] == job
    assert mine.ask("POST", f"/v1/jobs/{job}/cancel").status_code == 200
    assert other.ask("GET", f"/v1/jobs/{job}").json()["state"] == "queued"
    # The one who left has no say any more; the one who stays has.
    assert mine.ask("POST", f"/v1/jobs/{job}/cancel").status_code == 403
    assert other.ask("POST", f"/v1/jobs/{job}/cancel").json()["outcome"] == "cancelled"


def test_who_only_wants_it_too_ends_nothing(tenants) -> None:
    mine, other = tenants
    job = brought(mine).json()["id"]
    brought(other)
    assert other.ask("POST", f"/v1/jobs/{job}/cancel").json()["state"] == "queued"
    assert mine.ask("POST", f"/v1/jobs/{job}/cancel").json()["outcome"] == "cancelled"


def test_a_trial_that_is_opened_again_takes_a_place(tenants, monkeypatch) -> None:
    monkeypatch.setattr(files, "MAX_OPEN", 2)
    mine, _ = tenants
    first = brought(mine, 0).json()["id"]
    assert mine.ask("POST", f"/v1/jobs/{first}/cancel").status_code == 200
    assert [brought(mine, seed).status_code for seed in (1, 2)] == [202, 202]
    assert brought(mine, 0).status_code == 429
    assert mine.ask("GET", f"/v1/jobs/{first}").json()["outcome"] == "cancelled"


def test_an_errored_trial_that_is_tried_again_takes_a_place(tenants, context, monkeypatch) -> None:
    monkeypatch.setattr(files, "MAX_OPEN", 2)
    mine, _ = tenants
    first = brought(mine, 0).json()["id"]
    lease = context.store.leases.claim(f"simulate.{TRIAL['simulator']}", owner="simulate@here:1")
    context.store.leases.give_up(lease, "no reason", reason="simulator_fault")
    assert [brought(mine, seed).status_code for seed in (1, 2)] == [202, 202]
    assert mine.ask("POST", f"/v1/jobs/{first}/retry").status_code == 429
    assert mine.ask("GET", f"/v1/jobs/{first}").json()["outcome"] == "errored"
