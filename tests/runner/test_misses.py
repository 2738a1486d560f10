"""A runner harms only itself: what one key's runners miss, others may do, and no key ends a job."""

from __future__ import annotations

import hashlib
from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import text
from support.servers.runner_rig import Caller, pause_ends, runner_key, waiting

from buildarena_api.runners import lease_queue

FAULT = {"reason": "simulator_fault", "detail": "it hangs"}
NEVER = {**FAULT, "permanent": True}


@pytest.fixture
def keys(context, url):
    """Callers with keys of their own."""
    return [Caller(url, runner_key(context)[1]) for _ in range(3)]


def misses(caller: Caller, how: str, context) -> None:
    # The reaper may hold the row for a moment, and claims pass over what is held.
    lease = caller.lease(wait_s=5)
    if how == "lost":
        with context.store.database.transaction() as connection:
            connection.execute(text("UPDATE leases SET expires_at = now() - interval '1 s'"))
        context.store.leases.recover()
        return
    body = {"fault": FAULT, "never": NEVER}.get(how)
    path = "/hand-back" if body is None else "/fault"
    assert caller.ask("POST", caller.at(lease, path), json=body).status_code == 200


def offered(caller: Caller) -> bool:
    return caller.ask("POST", "/leases", json=caller.about(wait_s=1)).status_code == 200


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("how", ["fault", "hand back", "lost"])
def test_a_key_that_misses_a_trial_again_and_again_counts_once(context, keys, how) -> None:
    job = waiting(context)
    for _ in range(12):
        misses(keys[0], how, context)
        pause_ends(context)
    now = context.store.jobs.get(job.id)
    assert (now.state, now.faults) == ("queued", int(how != "hand back"))
    assert offered(keys[1])


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("how", ["fault", "hand back", "lost", "never"])
def test_a_key_waits_for_what_it_missed_and_others_do_not(context, keys, how) -> None:
    waiting(context)
    misses(keys[0], how, context)
    keys[0].name = "another-name"
    assert not offered(keys[0])
    assert offered(keys[1])


@pytest.mark.ci
def test_the_pause_grows(context, keys) -> None:
    waiting(context)

    def ended_ago(seconds: int) -> None:
        with context.store.database.transaction() as connection:
            connection.execute(
                text("UPDATE attempts SET ended_at = now() - make_interval(secs => :s)"),
                {"s": seconds},
            )

    for pause_s in (2, 4, 8, 16, 32):
        misses(keys[0], "fault", context)
        if pause_s >= 16:
            ended_ago(pause_s - 8)
            assert not offered(keys[0])
        ended_ago(pause_s + 1)


@pytest.mark.ci
def test_what_can_not_be_done_needs_two_keys(context, keys) -> None:
    job = waiting(context)
    misses(keys[0], "never", context)
    pause_ends(context)
    assert not offered(keys[0])
    now = context.store.jobs.get(job.id)
    assert now.state == "queued"
    assert "another key" in now.detail
    misses(keys[1], "fault", context)
    assert context.store.jobs.get(job.id).state == "queued"
    misses(keys[2], "never", context)
    now = context.store.jobs.get(job.id)
    assert (now.state, now.outcome, now.reason) == ("done", "errored", "simulator_fault")


def test_a_worker_of_the_house_still_does_what_runners_refuse(context, keys) -> None:
    job = waiting(context)
    misses(keys[0], "never", context)
    lease = context.store.leases.claim("simulate.mujoco", owner="simulate@here:1")
    assert lease.job.id == job.id
    context.store.leases.give_up(lease, "so it is", reason="game_version")
    assert context.store.jobs.get(job.id).outcome == "errored"


def test_reasons_are_those_of_a_list(context, keys) -> None:
    waiting(context)
    lease = keys[0].lease()
    body = {**FAULT, "reason": "because"}
    refused = keys[0].ask("POST", keys[0].at(lease, "/fault"), json=body)
    assert refused.status_code == 422
    assert "simulator_fault" in refused.text


def test_only_the_latest_faults_evidence_stays(context, keys) -> None:
    job = waiting(context)
    for number, caller in enumerate(keys):
        lease = caller.lease()
        data = f"log of {number}".encode()
        sent = {**caller.upload(lease, data), "name": f"log-0-{number}.txt"}
        body = {**FAULT, "files": [sent]}
        assert caller.ask("POST", caller.at(lease, "/fault"), json=body).status_code == 200
    assert [name for name in context.store.jobs.artifacts(job.id) if "log" in name] == [
        "log-0-2.txt"
    ]


def test_evidence_is_bounded(context, keys) -> None:
    waiting(context)
    lease = keys[0].lease()
    sha256 = hashlib.sha256(b"x").hexdigest()
    files = [{"name": "log-0-1.txt", "sha256": sha256, "size": 17 << 20}]
    refused = keys[0].ask("POST", keys[0].at(lease, "/fault"), json={**FAULT, "files": files})
    assert refused.status_code == 422
    assert f"{16 << 20:,}" in refused.text


def test_a_keys_leases_are_counted_as_they_are_given(context, url, keys, monkeypatch) -> None:
    monkeypatch.setattr(lease_queue, "MAX_LEASES", 5)
    for seed in range(12):
        waiting(context, seed=seed)
    secret = keys[0].secret
    with ThreadPoolExecutor(12) as at_once:
        statuses = list(
            at_once.map(
                lambda n: (
                    (caller := Caller(url, secret, name=f"r{n}"))
                    .ask("POST", "/leases", json={**caller.about(), "wait_s": 5})
                    .status_code
                ),
                range(12),
            )
        )
    assert sorted(statuses) == [200] * 5 + [429] * 7
