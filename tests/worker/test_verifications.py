"""Verifications are done by few threads of their own, all that wait, whatever messages say."""

from __future__ import annotations

import threading
import time

import pytest
from support.servers.stacks import wait_until

from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_worker.verification_report import Report
from buildarena_worker.verification_runner import AT_ONCE, VerificationRunner


class Slow:
    """Stands in for the replay: counts how many run at once."""

    def __init__(self, *, fails: bool = False) -> None:
        self._lock = threading.Lock()
        self._fails = fails
        self.now = self.most = self.done = 0

    def verify(self, _: str) -> Report:
        with self._lock:
            self.now += 1
            self.most = max(self.most, self.now)
        time.sleep(0.01)
        with self._lock:
            self.now -= 1
            self.done += 1
        if self._fails:
            raise RuntimeError("broken")
        return Report([])


@pytest.fixture
def asked(context, submissions) -> list[str]:
    sweep = submissions.submit_sweep(
        SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=30)
    ).sweep.id
    jobs = [job.id for job in context.store.jobs.page(limit=30, sweep_id=sweep)]
    requested = context.store.verifications.request(jobs, owner="key_a")
    assert (len(requested.ids), requested.left) == (30, ())
    return list(requested.ids.values())


@pytest.mark.ci
@pytest.mark.parametrize("fails", [False, True])
def test_one_message_has_all_done_and_few_at_once(context, asked, fails) -> None:
    slow = Slow(fails=fails)
    runner = VerificationRunner(context.store.verifications, slow)
    started = time.monotonic()
    for _ in range(50):
        runner.wake(asked[0])
    assert time.monotonic() - started < 1, "messages wait for no verification"
    wait_until(lambda: slow.done == 30, 20, "all are done")
    assert slow.most == AT_ONCE
    states = {context.store.verifications.get(id_).state for id_ in asked[:-AT_ONCE]}
    assert states == {"done"}
    wait_until(lambda: runner._active == 0, 5, "its threads rest")


def test_it_can_be_woken_again(context, asked) -> None:
    slow = Slow()
    runner = VerificationRunner(context.store.verifications, slow)
    runner.wake("")
    wait_until(lambda: slow.done == 30 and runner._active == 0, 20, "all are done")
    job = context.store.verifications.get(asked[0]).job_id
    again = context.store.verifications.request([job])
    assert set(again.ids) == {job}
    assert again.ids[job] not in asked
    runner.wake("")
    wait_until(lambda: slow.done == 31, 20, "the new one is done")
    wait_until(lambda: runner._active == 0, 5, "its threads rest")


def test_what_is_open_is_counted_by_owner(context, submissions, monkeypatch) -> None:
    from buildarena_store.jobs import verifications

    monkeypatch.setattr(verifications, "MAX_OPEN", 4)
    sweep = submissions.submit_sweep(
        SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=10)
    ).sweep.id
    jobs = [job.id for job in context.store.jobs.page(limit=30, sweep_id=sweep)]
    request = context.store.verifications.request
    first = request([jobs[0], *jobs[:6]], owner="key_a")
    assert (list(first.ids), list(first.left)) == (jobs[:4], jobs[4:6])
    assert list(request(jobs[:6], owner="key_b").ids) == jobs[:6]
    assert not request(jobs[8:], owner="key_a").ids
    assert list(request(jobs[8:]).ids) == jobs[8:]
