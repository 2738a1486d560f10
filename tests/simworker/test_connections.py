"""Connections that break and an API that is away cost time only; files are bounded."""

import hashlib
import io
import os
import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import httpx
import pytest
from support.clients.tenants import WITH_KEYS
from support.jobs import execute
from support.servers.flaky_proxy import flaky_proxy
from support.servers.live_api import live_api
from support.servers.runner_rig import MUJOCO, ended, runner_key, slot, waiting

from buildarena_api.routes import runner
from buildarena_api.runners.outcomes import drop_dead_uploads
from buildarena_backend.artifacts import uploads
from buildarena_backend.artifacts.uploads import Uploads
from buildarena_backend.errors import UploadError
from buildarena_backend.leases.runner_leases import JobToken
from buildarena_backend.trials.trials import File, TrialResult
from buildarena_simworker.engines import EngineSimulator
from buildarena_simworker.remote import api as remote_api

LEASE = ("job_0a", 3)


class WithLog(EngineSimulator):
    """The engine with a long log beside each trajectory."""

    log = File(data=os.urandom(1_500_000), media_type="text/plain")

    def run(self, trial) -> TrialResult:
        return replace(super().run(trial), files={"log-0.txt": self.log})


@pytest.fixture(autouse=True)
def short_pauses(monkeypatch) -> None:
    monkeypatch.setattr(remote_api, "LONGEST_PAUSE_S", 0.2)


def test_cut_uploads_are_sent_again_and_lost_answers_do_nothing_twice(context, url) -> None:
    job = waiting(context)
    secret = runner_key(context)[1]
    with flaky_proxy(url) as proxy, slot(proxy.url, secret, WithLog("mujoco")) as one:
        proxy.cut_after = [700_000, 300_000]
        proxy.swallow_answers = 2
        assert one.do_next(0)
    assert proxy.cuts == 4
    now = ended(context, job)
    assert (now.lease_token, now.faults) == (2, 0)
    kept = {file.name: file.sha256 for file in context.store.jobs.files(job.id)}
    assert context.artifacts.get(kept["log-0.txt"]) == WithLog.log.data
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]
    kinds = [event.kind for event in context.store.events.after(0, job_id=job.id)]
    assert kinds.count("done") == 1


def test_links_that_fall_silent_cost_a_time_out_each(context, url, monkeypatch) -> None:
    monkeypatch.setattr(remote_api, "TIMEOUT_S", 0.4)
    job = waiting(context)
    with flaky_proxy(url) as proxy, slot(proxy.url, runner_key(context)[1]) as one:
        proxy.silent = 1
        assert one.do_next(0)
        assert proxy.cuts >= 1
    assert ended(context, job).faults == 0
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]


@pytest.mark.ci
def test_an_api_that_is_away_is_waited_for(context) -> None:
    job = waiting(context)
    with live_api(context, **WITH_KEYS, lease_s=30.0) as url, flaky_proxy(url) as proxy:
        comes_back = threading.Timer(1.0, lambda: setattr(proxy, "away", False))

        class Away(EngineSimulator):
            def run(self, trial) -> TrialResult:
                done = super().run(trial)
                proxy.away = True
                comes_back.start()
                return done

        with slot(proxy.url, runner_key(context)[1], Away("mujoco")) as one:
            assert one.do_next(0)
        comes_back.join()
    ended(context, job)


@pytest.mark.ci
def test_who_waits_gets_what_comes_at_once_and_who_has_left_nothing(context, url) -> None:
    secret = runner_key(context)[1]
    with httpx.Client(base_url=url, headers={"Authorization": f"Bearer {secret}"}) as client:
        payload = {"name": "gone", "simulators": MUJOCO, "wait_s": 20}
        with pytest.raises(httpx.ReadTimeout):
            client.post("/v1/runner/leases", json=payload, timeout=0.7)
    with slot(url, secret) as one:
        comes = threading.Timer(0.8, waiting, [context])
        comes.start()
        started = time.monotonic()
        assert one.do_next(20)
        assert 0.7 < time.monotonic() - started < 5
        comes.join()
        assert not one.do_next(0.1)


@pytest.fixture
def store(tmp_path) -> Uploads:
    return Uploads(tmp_path)


def send(store: Uploads, data: bytes, lease: JobToken = LEASE) -> str:
    sha256 = hashlib.sha256(data).hexdigest()
    store.keep(lease, sha256, io.BytesIO(data))
    return sha256


def test_a_file_that_is_sent_twice_is_kept_once_and_ends_with_its_lease(store) -> None:
    for data in (b"", b"a", os.urandom(3 << 20)):
        digests = {send(store, data) for _ in range(2)}
        assert store.take(LEASE, *digests) == data
        store.drop(LEASE)
        assert store.leases() == set()
        with pytest.raises(UploadError, match="was not uploaded under this lease"):
            store.take(LEASE, *digests)


def test_what_is_uploaded_under_a_lease_is_bounded(store, monkeypatch) -> None:
    for name, most in (("MAX_LEASE_BYTES", 25), ("MAX_LEASE_FILES", 3)):
        monkeypatch.setattr(uploads, name, most)
    for data in (b"a" * 10, b"b" * 10, b"a" * 10):
        send(store, data)
    with pytest.raises(UploadError, match="at most 25 bytes"):
        send(store, b"c" * 10)
    send(store, b"d")
    with pytest.raises(UploadError, match="at most 3 files"):
        send(store, b"e")
    send(store, b"e", ("job_0a", 4))  # another lease has its own
    assert store.leases() == {LEASE, ("job_0a", 4)}


def test_uploads_of_leases_that_ended_are_removed(context, caller) -> None:
    leases = []
    for number in range(3):
        waiting(context, seed=number)
        caller.name = f"r{number}"
        leases.append(caller.lease())
        caller.upload(leases[-1], b"half a trial")
    dead, live, ended_one = leases
    caller.ask("POST", caller.at(ended_one, "/release"))
    kept = Uploads(context.settings.artifacts_location)
    assert kept.leases() == {(each["job_id"], each["token"]) for each in (dead, live)}
    lost = "UPDATE jobs SET lease_token = lease_token + 1 WHERE id = :id"
    execute(context, lost, {"id": dead["job_id"]})
    drop_dead_uploads(context, kept)
    assert kept.leases() == {(live["job_id"], live["token"])}


def test_requests_for_uploads_are_bounded(context, caller, monkeypatch) -> None:
    waiting(context)
    lease = caller.lease()

    def put(sha256: str, content: bytes | Iterator[bytes]) -> int:
        path = caller.at(lease, f"/uploads/{sha256}")
        return caller.ask("PUT", path, content=content).status_code

    # Bytes that look like deep JSON are bytes.
    brackets = b"[" * 1000
    digest = hashlib.sha256(brackets).hexdigest()
    monkeypatch.setattr(runner, "MAX_FILE_BYTES", 1000)
    assert put(digest, brackets) == 204
    assert put(digest, brackets[1:]) == 422
    assert put(digest, brackets + b"[") == 413
    assert put(digest, iter([brackets, b"["])) == 413, "whatever its length says"
    for sha256 in ("A" * 64, "a" * 63, "a" * 65, "..%2f" + "a" * 60, "g" * 64):
        assert put(sha256, b"x") in {404, 422}, sha256
    caller.ask("POST", caller.at(lease, "/release"))
    assert put(digest, brackets) == 409
