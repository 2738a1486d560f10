"""Connections that break and an API that is away cost time only."""

import os
import threading
import time
from dataclasses import replace

import httpx
import httpx2
import pytest
from sqlalchemy import text
from support.clients.tenants import WITH_KEYS
from support.servers.flaky_proxy import flaky_proxy
from support.servers.live_api import live_api
from support.servers.runner_rig import MUJOCO, ended, runner_key, slot, true_trajectory, waiting

from buildarena_pipeline.keepalive import socket_options
from buildarena_pipeline.runtime.context import open_context
from buildarena_pipeline.runtime.simulators.simulator import File, TrialResult
from buildarena_simulation import write_trajectory
from buildarena_simworker.engines import EngineSimulator
from buildarena_simworker.remote import api as remote_api
from buildarena_simworker.remote.api import HeldLease, RunnerApi, tls_context


class WithLog(EngineSimulator):
    """The engine with a long log beside each trajectory."""

    def __init__(self, size: int) -> None:
        super().__init__("mujoco")
        self._log = File(data=os.urandom(size), media_type="text/plain")

    def run(self, trial) -> TrialResult:
        return replace(super().run(trial), files={"log-0.txt": self._log})


@pytest.fixture(autouse=True)
def short_pauses(monkeypatch) -> None:
    monkeypatch.setattr(remote_api, "LONGEST_PAUSE_S", 0.2)


@pytest.mark.ci
def test_uploads_go_on_where_they_were_cut(context, url) -> None:
    job = waiting(context)
    log = WithLog(3_500_000)
    with flaky_proxy(url) as proxy:
        proxy.cut_after = [700_000, 1_500_000, 300_000]
        with slot(proxy.url, runner_key(context)[1], log) as one:
            assert one.do_next(0)
    assert proxy.cuts == 3
    ended(context, job)
    kept = {file.name: file.hash for file in context.store.jobs.files(job.id)}
    assert context.artifacts.get(kept["log-0.txt"]) == log._log.data
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("lost", [1, 2, 5])
def test_lost_answers_do_nothing_twice(context, url, lost) -> None:
    job = waiting(context)
    with (
        flaky_proxy(url) as proxy,
        slot(proxy.url, runner_key(context)[1]) as one,
    ):
        proxy.swallow_answers = lost  # of the lease, the upload, the outcome and heartbeats
        assert one.do_next(0)
        assert proxy.cuts >= 1
    now = ended(context, job)
    assert (now.lease_token, now.faults) == (2, 0)
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]
    with context.store.database.statement() as connection:
        ends = text("SELECT count(*) FROM events WHERE kind = 'done'")
        assert connection.execute(ends).scalar_one() == 1


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("silent", [1, 3])
def test_links_that_fall_silent_cost_a_time_out_each(context, url, monkeypatch, silent) -> None:
    monkeypatch.setattr(remote_api, "TIMEOUT_S", 0.4)
    job = waiting(context)
    with (
        flaky_proxy(url) as proxy,
        slot(proxy.url, runner_key(context)[1]) as one,
    ):
        proxy.silent = silent
        assert one.do_next(0)
        assert proxy.cuts >= 1
    assert ended(context, job).faults == 0
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]


def test_a_runner_gives_up_dead_links_unless_a_proxy_ends_them(url, monkeypatch) -> None:
    for name in [name for name in os.environ if name.lower().endswith("_proxy")]:
        monkeypatch.delenv(name)

    def options() -> object:
        stopping = threading.Event()
        api = RunnerApi(url, None, tls=tls_context(None), stopping=stopping)
        found = api._http._transport_for_url(httpx2.URL(url))._pool._socket_options
        api.close()
        return found

    assert options() == socket_options()
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    assert options() is None


@pytest.mark.ci
def test_an_api_that_is_away_is_waited_for(context) -> None:
    own = open_context(context.settings.model_copy(update={**WITH_KEYS, "lease_s": 30.0}))
    job = waiting(context)
    secret = runner_key(context)[1]
    with live_api(own) as url, flaky_proxy(url) as proxy:
        comes_back = threading.Timer(1.0, lambda: setattr(proxy, "away", False))

        class Away(EngineSimulator):
            def run(self, trial) -> TrialResult:
                done = super().run(trial)
                proxy.away = True
                comes_back.start()
                return done

        with slot(proxy.url, secret, Away("mujoco")) as one:
            assert one.do_next(0)
        comes_back.join()
    own.close()
    ended(context, job)


def test_an_outcome_that_comes_too_late_is_left(context, url) -> None:
    job = waiting(context)
    data = write_trajectory(true_trajectory(context, job))
    with slot(url, runner_key(context)[1]) as one:
        document = one.api.lease(one.about, 0)
        assert document is not None
        lease = HeldLease(job_id=document["job_id"], token=document["token"] - 1)
        with pytest.raises(Exception, match="is over, or is not this key's"):
            one.api.upload(lease, data)


@pytest.mark.ci
def test_nothing_is_leased_to_who_has_left(context, url) -> None:
    secret = runner_key(context)[1]
    with httpx.Client(base_url=url, headers={"Authorization": f"Bearer {secret}"}) as client:
        payload = {"name": "gone", "simulators": MUJOCO, "wait_s": 20}
        with pytest.raises(httpx.ReadTimeout):
            client.post("/v1/runner/leases", json=payload, timeout=0.7)
    job = waiting(context)
    with slot(url, secret) as one:
        assert one.do_next(2)
    assert ended(context, job).faults == 0


@pytest.mark.ci
def test_who_waits_gets_what_comes_at_once(context, url) -> None:
    secret = runner_key(context)[1]
    with slot(url, secret) as one:
        comes = threading.Timer(0.8, waiting, [context])
        comes.start()
        started = time.monotonic()
        assert one.do_next(20)
        assert 0.7 < time.monotonic() - started < 5
        comes.join()
        assert not one.do_next(0.1)
