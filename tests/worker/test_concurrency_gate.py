from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from buildarena_worker.session.concurrency_gate import ConcurrencyGate


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
