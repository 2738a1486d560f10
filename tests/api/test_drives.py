"""Drives over a real socket: keys move a machine at once, and the job has them forever."""

import json
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from support.clients.tenants import WITH_KEYS
from support.machines.families import car
from support.servers.live_api import changed, live_api
from support.stages import work
from websockets.sync.client import ClientConnection, connect

from buildarena_benchmark import parse_custom_task
from buildarena_geometry import Machine
from buildarena_pipeline.runtime.context import Context
from buildarena_simulation import read_trajectory, simulate, write_trajectory
from buildarena_store import Job
from buildarena_worker.wiring import verifier

TASK = Path(__file__).parents[2] / "examples" / "control" / "to-the-mark.yaml"


@pytest.fixture
def served(context: Context) -> Iterator[str]:
    with live_api(context) as url:
        yield url


class Driver:
    """A page's end of the socket."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.news: list[dict] = []

    def say(self, **message: object) -> None:
        self.socket.send(json.dumps(message))

    def hear(self) -> tuple[float, int, np.ndarray] | dict:
        message = self.socket.recv(timeout=30)
        if isinstance(message, str):
            self.news.append(json.loads(message))
            return self.news[-1]
        time_s, number = struct.unpack_from("<fI", message)
        return time_s, number, np.frombuffer(message, "<f4", offset=8).reshape(-1, 7)

    def until(self, kind: str) -> dict:
        while True:
            heard = self.hear()
            if isinstance(heard, dict):
                assert heard["type"] == kind, heard
                return heard


@contextmanager
def driver(url: str, **hello: object) -> Iterator[Driver]:
    with connect(f"{url.replace('http', 'ws')}/v1/drives", max_size=None) as socket:
        one = Driver(socket)
        one.say(**{"machine": car(drive=()).to_document(), "simulator": "mujoco", **hello})
        yield one


@pytest.mark.nightly
def test_free_ground_is_driven_by_keys_and_stored_nowhere(served) -> None:
    with driver(served) as one:
        ready = one.until("ready")
        assert ready["job"] is None
        assert any("spinning_forward" in what for what in ready["keys"]["UpArrow"])
        first = one.hear()
        assert first[0] == 0
        one.say(held=["UpArrow"], number=1)
        asked = time.monotonic()
        while True:
            _, number, poses = one.hear()
            if np.abs(poses - first[2]).max() > 1e-3 and number == 1:
                break
        assert time.monotonic() - asked < 0.5  # of 0.1 s on a machine with nothing else to do
        assert len(poses) == len(ready["scene"]["machine"]["blocks"])
        one.say(held=[], number=2, end=True)
        ended = one.until("ended")
        assert (ended["why"], ended["job"]) == ("stopped", None)
        assert {press["key"] for press in ended["presses"]} == {"UpArrow"}


def driven(context: Context, url: str, *, seconds: float = 2.0, **more: object) -> dict:
    """A drive on a short task, to its end; the last message."""
    text = TASK.read_text("utf-8").replace("duration_s: 20", f"duration_s: {seconds:g}")
    task = parse_custom_task(text, origin="test")
    context.tasks.add(task, text)
    with driver(url, task=task.name, **more) as one:
        one.until("ready")
        for number, held in enumerate((["UpArrow"], ["UpArrow", "LeftArrow"], ["DownArrow"])):
            one.say(held=held, number=number)
            time.sleep(0.2)
        return one.until("ended")


def job_of(context: Context, ended: dict) -> Job:
    return context.store.jobs.get(ended["job"])


@pytest.mark.nightly
def test_a_drive_stands_under_a_name_with_the_keys_and_is_verified(context, served) -> None:
    ended = driven(context, served, driver="ada")
    assert ended["why"] == "time"
    assert {press["key"] for press in ended["presses"]} == {"UpArrow", "LeftArrow", "DownArrow"}
    work(context, queues=("simulate.mujoco",))
    job = job_of(context, ended)
    assert (job.model, job.seed, job.state) == ("human/ada", 0, "done")
    assert job.track.startswith("piloted/mujoco-")
    files = context.store.jobs.artifacts(job.id)
    machine = Machine.from_document(json.loads(context.artifacts.get(files["machine"])))
    assert [
        {"time_s": press.time_s, "key": press.key, "hold_for_s": press.hold_for_s}
        for press in machine.control_sequence
    ] == ended["presses"]
    task = context.tasks.exact(job.task, job.task_version)
    stored = context.artifacts.get(files["trajectory-0"])
    assert write_trajectory(simulate(machine, task.scenario, "mujoco")) == stored
    assert np.ptp(read_trajectory(stored).positions[:, 0], axis=0).max() > 1
    report = verifier(context).verify(job.id)
    assert report.verdict == "verified", report
    assert driven(context, served, driver="ada", seconds=1.0)["job"] != job.id


@pytest.mark.nightly
def test_a_drive_of_twenty_seconds_is_verified(context, served) -> None:
    ended = driven(context, served, driver="ada", seconds=20)
    assert ended["why"] == "time"
    work(context, queues=("simulate.mujoco",))
    job = job_of(context, ended)
    stored = context.artifacts.get(context.store.jobs.artifacts(job.id)["trajectory-0"])
    assert read_trajectory(stored).time_s[-1] == pytest.approx(20, abs=0.1)
    report = verifier(context).verify(job.id)
    assert report.verdict == "verified", report


@pytest.mark.nightly
def test_a_page_that_is_gone_ends_the_drive_with_what_there_is(context, served) -> None:
    text = TASK.read_text("utf-8")
    task = parse_custom_task(text, origin="test")
    context.tasks.add(task, text)
    with driver(served, task=task.name, driver="ada") as one:
        ready = one.until("ready")
        one.say(held=["UpArrow"])
        while one.hear()[0] < 0.3:
            pass
    job = job_of(context, ready)
    until = time.monotonic() + 10
    while job.state == "running":
        assert time.monotonic() < until
        time.sleep(0.01)
        job = job_of(context, ready)
    assert (job.state, job.queue) == ("queued", "simulate.mujoco")
    files = context.store.jobs.artifacts(job.id)
    document = json.loads(context.artifacts.get(files["machine"]))
    (press,) = document["control_sequence"]
    assert press["key"] == "UpArrow"
    assert 0.2 < press["hold_for_s"] < 5


def refusal(url: str, **hello: object) -> tuple[int, str]:
    with driver(url, **hello) as one:
        problem = one.until("problem")["problem"]
        return problem["status"], problem["detail"]


@pytest.mark.nightly
def test_what_cannot_be_driven_is_refused_in_words(context, served) -> None:
    status, detail = refusal(served, task="support-9")
    assert (status, "support-1" in detail or "support-9" in detail) == (422, True)
    assert refusal(served, simulator="besiege")[1].endswith("choose mujoco or pybullet")
    assert refusal(served, machine={"blocks": []})[0] == 422
    assert refusal(served, engine="mujoco")[0] == 422
    status, detail = refusal(served, task="lift-3", driver="ada")
    assert (status, "machine" in detail) == (422, True)
    assert "dots" in refusal(served, task="support-1", driver="../ada")[1]
    assert not context.store.jobs.page(limit=10)


@pytest.mark.nightly
def test_a_key_is_asked_for_and_drives_are_bounded(context) -> None:
    with changed(context, **WITH_KEYS) as own, live_api(own) as url:
        assert refusal(url) == (401, "an API key is needed: send `Authorization: Bearer KEY`")
        assert refusal(url, key="guessed")[0] == 401
        key = WITH_KEYS["admin_key"].get_secret_value()
        with ExitStack() as open_drives:
            for _ in range(4):
                open_drives.enter_context(driver(url, key=key)).until("ready")
            status, detail = refusal(url, key=key)
            assert (status, "4 drives" in detail) == (429, True)
