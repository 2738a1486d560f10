"""Work in a process apart: what ends that process costs one piece of work."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from multiprocessing.context import SpawnProcess

import psutil
import pytest
from support.warm_work import make

from buildarena_environment.warm_process import ProcessEndedError, WarmProcess

SPARE = 200 << 20


@pytest.fixture
def process() -> Iterator[WarmProcess]:
    made = WarmProcess("work", make, spare_bytes=SPARE)
    yield made
    made.close()


def test_it_stays_warm_between_questions(process) -> None:
    pid = process.ask(["pid"])
    assert pid != os.getpid()
    assert process.ask(["hello"]) == "hello"
    assert process.ask(["pid"]) == pid


def test_it_outlives_the_thread_that_asked_first(process) -> None:
    """A service's threads come and go."""
    pids: list[int] = []
    for _ in range(2):
        thread = threading.Thread(target=lambda: pids.append(process.ask(["pid"])))
        thread.start()
        thread.join()
        time.sleep(0.2)
    assert pids == [process.ask(["pid"])] * 2


@pytest.mark.ci
def test_one_that_dies_is_started_again(process) -> None:
    first = process.ask(["pid"])
    with pytest.raises(ProcessEndedError, match="of work ended with code -9") as raised:
        process.ask(["die"])
    assert raised.value.code == -signal.SIGKILL
    assert process.ask(["pid"]) != first
    psutil.Process(process.ask(["pid"])).kill()  # between two questions
    time.sleep(0.2)
    assert process.ask(["hello"]) == "hello"


@pytest.mark.ci
def test_memory_is_bounded(process) -> None:
    assert process.ask(["take", SPARE // 4]) == SPARE // 4
    with pytest.raises(ProcessEndedError):
        process.ask(["take", 2 * SPARE])
    assert process.ask(["hello"]) == "hello"


@pytest.mark.ci
def test_work_that_is_given_up_is_broken_off(process) -> None:
    pid = process.ask(["pid"])

    def enough() -> None:
        raise TimeoutError("enough")

    started = time.monotonic()
    with pytest.raises(TimeoutError, match="enough"):
        process.ask(["sleep", 60], meanwhile=enough)
    assert time.monotonic() - started < 5
    assert not psutil.pid_exists(pid)
    assert process.ask(["hello"]) == "hello"


def test_closing_leaves_no_process(process) -> None:
    pid = process.ask(["pid"])
    process.close()
    assert not psutil.pid_exists(pid)


def test_one_that_is_just_being_started_is_ended_too(process, monkeypatch) -> None:
    starts, closes = threading.Event(), threading.Event()
    start_process = SpawnProcess.start

    def start_slowly(self: SpawnProcess) -> None:
        starts.set()
        closes.wait(10)
        time.sleep(0.2)  # time for the other thread to get as far as it can
        start_process(self)

    monkeypatch.setattr(SpawnProcess, "start", start_slowly)
    answers: list[object] = []

    def ask() -> None:
        try:
            answers.append(process.ask(["sleep", 60]))
        except ProcessEndedError as ended:
            answers.append(ended)

    asker = threading.Thread(target=ask)
    asker.start()
    assert starts.wait(10)
    closes.set()
    process.close()
    asker.join(10)
    assert not asker.is_alive()
    assert isinstance(answers[0], ProcessEndedError)
    assert process.pid is None
