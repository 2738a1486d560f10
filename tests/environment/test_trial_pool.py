"""Processes that environments of several tasks share for their trials."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import psutil
import pytest
from support.machines.expert_calls import played

from buildarena_environment import Environment, TrialPool
from buildarena_simulation import SimulationError

TASKS = ("support-1", "lift-1", "lift-2", "support-1")


def children() -> list[psutil.Process]:
    return [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]


@pytest.mark.ci
def test_environments_of_several_tasks_share_it_and_score_as_without(experts) -> None:
    with TrialPool(2) as pool, ThreadPoolExecutor(4) as threads:
        shared = [
            played(Environment(task, tries=pool.try_machine), experts[task]["calls"])
            for task in TASKS
        ]
        found = list(threads.map(lambda environment: environment.submit().trial, shared))
        alone = {
            task: played(Environment(task), experts[task]["calls"]).submit().trial.score
            for task in set(TASKS)
        }
    assert [trial.score for trial in found] == [alone[task] for task in TASKS]


@pytest.mark.ci
def test_a_process_that_dies_costs_one_submission_which_can_be_made_again(experts) -> None:
    before = set(children())
    with TrialPool(1) as pool:
        environment = played(
            Environment("transport-1", tries=pool.try_machine), experts["transport-1"]["calls"]
        )
        played(Environment("lift-1", tries=pool.try_machine), experts["lift-1"]["calls"]).submit()
        (child,) = set(children()) - before
        child.suspend()  # stopped, it can't be done before it is killed
        threading.Timer(0.2, os.kill, (child.pid, signal.SIGKILL)).start()
        with pytest.raises(SimulationError, match="ended with code -9"):
            environment.submit()
        assert not environment.done
        assert environment.submit().trial.score.success


def test_closing_with_trials_under_way_leaves_no_process(experts) -> None:
    before = set(children())
    pool = TrialPool(1)
    environment = played(Environment("transport-1"), experts["transport-1"]["calls"])
    text = json.dumps(environment.machines["main"].to_document())
    waiting = [pool.submit(environment.task, text, "mujoco") for _ in range(20)]
    while not set(children()) - before:
        time.sleep(0.01)
    started = time.monotonic()
    pool.close()
    assert time.monotonic() - started < 60
    assert set(children()) == before
    assert all(future.done() for future in waiting)
    assert any(future.cancelled() for future in waiting)
