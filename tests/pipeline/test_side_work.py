from __future__ import annotations

import threading

import pytest
from running import wait_until

from buildarena_pipeline.runtime.side_work import SideWork


def test_a_flood_of_side_work_takes_two_threads_and_is_all_done() -> None:
    let_go, done, at_once, lock = threading.Event(), [], [0, 0], threading.Lock()

    def work(work_id: str) -> None:
        with lock:
            at_once[0] += 1
            at_once[1] = max(at_once)
        let_go.wait(10)
        with lock:
            at_once[0] -= 1
            done.append(work_id)

    side = SideWork(work)
    threads = [threading.Thread(target=side.do, args=(str(n // 2),)) for n in range(40)]
    for thread in threads:
        thread.start()
    wait_until(lambda: sum(thread.is_alive() for thread in threads) == 2, 5, "two are at work")
    let_go.set()
    for thread in threads:
        thread.join(5)
    assert at_once == [0, 2]
    assert set(done) == {str(n) for n in range(20)}
    # Named again while it was at work: done again, never dropped.
    assert len(done) <= 22


def test_work_that_fails_leaves_its_thread_to_the_next() -> None:
    def work(work_id: str) -> None:
        raise ValueError(work_id)

    side = SideWork(work, threads=1)
    for work_id in "ab":
        with pytest.raises(ValueError, match=work_id):
            side.do(work_id)


def test_nothing_is_begun_after_the_stop() -> None:
    done: list[str] = []
    side = SideWork(done.append)
    side.do("a")
    side.stop()
    side.do("b")
    assert done == ["a"]
