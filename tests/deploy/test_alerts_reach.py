"""Faults in a running service: the alert arrives, and its runbook's words end it."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
from support.documents.runbook import entry
from support.servers.prometheus import (
    RUNBOOK,
    Receiver,
    alertmanager,
    needs_alertmanager,
    prometheus,
    target_says,
)
from support.servers.stacks import finished, hung, kill, running_stack, wait_until, without_store

from buildarena_cli.local.stack import Stack

pytestmark = [needs_alertmanager, pytest.mark.ci, pytest.mark.timeout(600)]
WITHIN_S = 60.0
BUILDARENA = str(Path(sys.executable).parent / "buildarena")


class Operator:
    """Somebody who knows the runbook and nothing else.

    Attributes:
        stack: The service.
        receiver: What they are told.
    """

    def __init__(self, stack: Stack, receiver: Receiver) -> None:
        self.stack, self.receiver = stack, receiver

    def is_told(self, alert: str) -> dict[str, str]:
        """Waits for an alert; its labels."""
        told = wait_until(
            lambda: self.receiver.heard(alert, "firing"), WITHIN_S, f"{alert} is heard"
        )
        assert told["annotations"]["runbook_url"] == f"{RUNBOOK}#{alert.lower()}"
        assert told["annotations"]["summary"]
        assert "runbook" not in told["labels"]
        return dict(told["labels"])

    def is_relieved(self, alert: str) -> None:
        """Waits until the alert is over."""
        wait_until(lambda: self.receiver.heard(alert, "resolved"), WITHIN_S, f"{alert} is over")

    def words(self, alert: str, part: str, start: str, **names: str) -> list[str]:
        """The command of an entry that begins so, with names in place of its capital words."""
        commands = re.findall(r"`([^`]+)`", entry(alert)[part])
        (command,) = [each for each in commands if each.startswith(start)]
        names = {"URL": self.stack.url, **names}
        return [re.sub(r"\b[A-Z]{2,}\b", lambda m: names[m[0]], w) for w in shlex.split(command)]

    def does(self, alert: str, part: str, start: str, **names: str) -> str:
        """Does what the entry says; what was printed."""
        words = self.words(alert, part, start, **names)
        return self._ran(BUILDARENA if words[0] == "buildarena" else words[0], *words[1:])

    def doctor(self) -> str:
        """What every entry has one look at first."""
        return self._ran(BUILDARENA, "doctor", "--url", self.stack.url)

    def _ran(self, *words: str) -> str:
        environment = {**self.stack.environment, "BUILDARENA_URL": self.stack.url}
        done = subprocess.run(
            words, env=environment, capture_output=True, text=True, timeout=60, check=False
        )
        return done.stdout + done.stderr


@pytest.fixture(scope="module")
def operator(tmp_path_factory) -> Iterator[Operator]:
    folder = tmp_path_factory.mktemp("alerts")
    with (
        running_stack(folder, simulators=()) as stack,
        alertmanager(folder) as receiver,
        prometheus(
            folder, stack.url, None, every_s=1, alertmanager=receiver.address, waits=False
        ) as client,
    ):
        target_says(client, "up")
        wait_until(lambda: receiver.watchdog, WITHIN_S, "the watchdog is heard")
        yield Operator(stack, receiver)


def submitted(operator: Operator, **sweep: object) -> str:
    answer = httpx.post(
        f"{operator.stack.url}/v1/sweeps",
        json={"tasks": ["support-1"], "simulator": "mujoco", "worlds": 1, "samples": 1, **sweep},
    )
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


@pytest.mark.nightly
def test_jobs_that_no_worker_serves(operator) -> None:
    alert = "BuildArenaNoWorkers"
    sweep = submitted(operator, models=["builtin/expert"])
    queue = operator.is_told(alert)["queue"]
    shown = operator.doctor()
    assert re.search(rf"!! +workers of {queue} +0 alive; 1 waiting", shown), shown
    words = operator.words(alert, "Do", "buildarena admin worker", QUEUE=queue)
    with ExitStack() as stack:
        process = stack.enter_context(
            subprocess.Popen(
                [BUILDARENA, *words[1:]],
                env={**operator.stack.environment},
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        )
        stack.callback(process.terminate)
        operator.is_relieved(alert)
        with httpx.Client(base_url=operator.stack.url) as client:
            assert finished(client, sweep)["progress"]["done"] == 1


def test_a_budget_that_is_used_up(operator) -> None:
    alert = "BuildArenaBudgetExhausted"
    sweep = submitted(operator, models=["builtin/random"], budget={"max_requests": 1})
    assert operator.is_told(alert)["severity"] == "info"
    assert re.search(r"ok +budgets +1 sweeps wait", operator.doctor())
    assert sweep[:8] in operator.does(alert, "Look", "buildarena sweep list")
    operator.does(alert, "Do", "buildarena sweep cancel", ID=sweep)
    operator.is_relieved(alert)


def test_a_broker_that_hangs(operator) -> None:
    alert = "BuildArenaBrokerDown"
    with hung(operator.stack, "valkey"):
        operator.is_told(alert)
        assert re.search(r"!! +broker ", operator.doctor())
        kill(operator.stack, "valkey")
    operator.is_relieved(alert)


def test_a_database_that_hangs(operator) -> None:
    alert = "BuildArenaDatabaseDown"
    with hung(operator.stack, "postgres"):
        operator.is_told(alert)
        assert "has not answered for" in operator.does(alert, "Look", "curl URL")
        assert re.search(r"!! +database +has not answered for", operator.doctor())
        kill(operator.stack, "postgres")
    operator.is_relieved(alert)


def test_an_api_that_hangs(operator) -> None:
    alert = "BuildArenaApiDown"
    with hung(operator.stack, "api"):
        operator.is_told(alert)
        kill(operator.stack, "api")
    operator.is_relieved(alert)
    assert "200 OK" in operator.does(alert, "Look", "curl -i")


def test_a_store_that_takes_nothing(operator) -> None:
    alert = "BuildArenaArtifactStoreDown"
    with without_store(operator.stack):
        operator.is_told(alert)
        assert re.search(r"!! +artifacts ", operator.doctor())
    operator.is_relieved(alert)


def test_workers_that_are_killed_again_and_again(operator) -> None:
    """In containers each has the number of the one before; their names differ all the same."""
    for _ in range(4):
        before = {each["id"] for each in _workers(operator)}
        kill(operator.stack, "construct worker")
        wait_until(
            lambda: {each["id"] for each in _workers(operator)} - before,
            WITHIN_S,
            "another took its place",
        )
    assert operator.is_told("BuildArenaWorkersLost")["kind"] == "construct"
    assert re.search(r"!! +silent workers +[4-9] of construct", operator.doctor())


def _workers(operator: Operator) -> list[dict[str, object]]:
    answer = httpx.get(f"{operator.stack.url}/v1/workers", timeout=20)
    return list(answer.json()["workers"])
