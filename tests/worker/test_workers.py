"""Workers beside each other: stops that lose nothing, places, verifications."""

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from sqlalchemy import event
from support.providers.stand_in import ProviderStandIn
from support.servers.construct_threads import Crew, crew, worker_process
from support.servers.stacks import wait_until

from buildarena_backend.accounts.budgets import BudgetLimits
from buildarena_backend.catalog.specs import SweepSpec
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.verify.report import Report
from buildarena_worker.wiring import AT_ONCE, VerificationRunner

SESSIONS = 16


@contextmanager
def slow_database(context, seconds: float) -> Iterator[None]:
    """Each statement of this process takes so much longer."""
    engine = context.store.database.engine

    def wait(*_: object) -> None:
        time.sleep(seconds)

    event.listen(engine, "before_cursor_execute", wait)
    try:
        yield
    finally:
        event.remove(engine, "before_cursor_execute", wait)


def stop(workers: Crew, *, finishing_s: float) -> None:
    """What the process does when it is asked to stop."""
    workers.runner.stop()
    workers.keeper.drain(finishing_s)
    workers.keeper.stop()


def answered(context, job_ids: Sequence[str]) -> int:
    return sum(len(context.store.journal.read(job_id)) for job_id in job_ids)


def attempts(context, job_ids: Sequence[str]) -> list[str | None]:
    return [a.result for job_id in job_ids for a in context.store.jobs.attempts(job_id)]


@pytest.mark.parametrize(
    ("latency_s", "statement_s"),
    [(1.5, 0.1), pytest.param(12.0, 1.0, marks=pytest.mark.nightly)],
)
def test_open_requests_are_answered_and_are_kept(context, tmp_path, latency_s, statement_s) -> None:
    with ProviderStandIn(latency_s=latency_s) as model:
        with crew(context, tmp_path, slots=SESSIONS, good=model) as workers:
            jobs = [workers.submit("good", seed=seed) for seed in range(SESSIONS)]
            wait_until(lambda: model.counts.requests >= SESSIONS, 60, "all have asked")
            with slow_database(context, statement_s):
                stop(workers, finishing_s=40)
                sent = model.counts.requests
                assert answered(context, jobs) == sent
        assert attempts(context, jobs) == ["handed_back"] * SESSIONS
        assert {context.store.jobs.get(job).state for job in jobs} == {"queued"}
        model.latency_s = 0.0
        with crew(context, tmp_path, slots=SESSIONS, good=model) as workers:
            stages = {"simulate"}
            wait_until(lambda: {workers.job(j).stage for j in jobs} == stages, 60, "all go on")
        assert model.counts.requests == answered(context, jobs)
        assert attempts(context, jobs) == ["handed_back", "done"] * SESSIONS


@pytest.mark.ci
def test_a_request_that_takes_too_long_is_given_up_and_counted(context, tmp_path) -> None:
    with context.store.database.transaction() as connection:
        context.store.budgets.set("key_a", BudgetLimits(max_requests=9), connection=connection)
    model = ProviderStandIn(fault=lambda _: "hang")
    with model, crew(context, tmp_path, good=model) as workers:
        job = workers.submit("good", owner="key_a")
        wait_until(lambda: model.counts.requests, 20, "it has asked")
        started = time.monotonic()
        stop(workers, finishing_s=0.5)
        assert 0.5 <= time.monotonic() - started < 5
        wait_until(lambda: workers.slots.free == workers.slots.total, 5, "the slot is free")
    assert attempts(context, [job]) == ["handed_back"]
    spent = context.store.budgets.get("key_a")
    assert spent is not None
    assert spent.lost_requests == 1


@pytest.mark.ci
def test_nothing_is_sent_again_after_the_stop(context, tmp_path) -> None:
    model = ProviderStandIn(fault=lambda _: "500")
    with model, crew(context, tmp_path, good=model) as workers:
        job = workers.submit("good")
        # The waits double: after four tries the next is 4 s at least.
        wait_until(lambda: model.counts.requests >= 4, 20, "tries")
        started, sent = time.monotonic(), model.counts.requests
        stop(workers, finishing_s=20)
        assert time.monotonic() - started < 3
        assert model.counts.requests <= sent + 1
    assert attempts(context, [job]) == ["handed_back"]
    assert context.store.jobs.get(job).faults == 0


@pytest.mark.ci
def test_a_worker_that_is_asked_to_stop_waits_for_its_reply(context, tmp_path) -> None:
    model = ProviderStandIn(latency_s=1.5)
    with model, worker_process(context, tmp_path, model) as (job_id, process):
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=20) == 0
    assert answered(context, [job_id]) == model.counts.requests
    assert attempts(context, [job_id]) == ["handed_back"]
    assert context.store.jobs.get(job_id).state == "queued"


class Crowd:
    """Counts how many work at once."""

    def __init__(self) -> None:
        self.now = self.most = 0
        self._lock = threading.Lock()

    def come(self, change: int = 1) -> None:
        with self._lock:
            self.now += change
            self.most = max(self.most, self.now)


def test_few_work_at_once_and_all_get_their_turn() -> None:
    gate, crowd = ConcurrencyGate(places=3, patience_s=60), Crowd()

    def session(_: int) -> None:
        with gate.acquired():
            for _ in range(20):
                crowd.come()
                threading.Event().wait(0.0005)
                crowd.come(-1)
                with gate.released():
                    threading.Event().wait(0.0005)

    with ThreadPoolExecutor(16) as threads:
        list(threads.map(session, range(16)))
    assert crowd.most == 3
    assert crowd.now == 0


def test_who_waits_leaves_its_place_to_others() -> None:
    gate, started = ConcurrencyGate(places=1, patience_s=60), threading.Event()

    def other() -> None:
        with gate.acquired():
            started.set()

    with gate.acquired(), ThreadPoolExecutor(1) as threads:
        came = threads.submit(other)
        with gate.released():
            assert started.wait(30)
        came.result()


def test_a_stuck_session_does_not_stop_the_others() -> None:
    gate = ConcurrencyGate(places=1, patience_s=0.01)

    def other() -> str:
        with gate.acquired(), gate.released():
            return "done"

    with gate.acquired(), ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda _: other(), range(4))) == ["done"] * 4


def test_an_error_gives_the_place_back() -> None:
    gate = ConcurrencyGate(places=1, patience_s=60)
    for _ in range(3):
        with pytest.raises(ZeroDivisionError), gate.acquired(), gate.released():
            raise ZeroDivisionError
    with gate.acquired(), ThreadPoolExecutor(1) as threads:
        assert not threads.submit(gate._places.acquire, blocking=False).result()


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
    spec = SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=30)
    sweep = submissions.submit_sweep(spec).sweep.id
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
        runner.wake()
    assert time.monotonic() - started < 1, "messages wait for no verification"
    wait_until(lambda: slow.done == 30, 20, "all are done")
    assert slow.most == AT_ONCE
    states = {context.store.verifications.get(id_).state for id_ in asked[:-AT_ONCE]}
    assert states == {"done"}
    wait_until(lambda: runner._places._value == AT_ONCE, 5, "its threads rest")
