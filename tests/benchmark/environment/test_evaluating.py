"""Many trials over processes: in order, the same however many, and a crash costs one."""

import json
import os
import signal
import threading
import time

import psutil
import pytest
from support.machines.expert_calls import played
from support.machines.trials import changed

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import Environment, Evaluator, TrialPool, try_machine
from buildarena_benchmark.scores import decided_length
from buildarena_geometry import DocumentError, Machine
from buildarena_simulation import SimulationError


@pytest.fixture(scope="module")
def short():
    """The first bridge, with a trial of three seconds."""
    return changed(builtin_tasks()["support-1"], duration_s=3.0)


def variants(bridge: Machine, count: int) -> list[Machine]:
    """Bridges with a brace more or less, and one that is nothing."""
    made = []
    for number in range(count):
        machine = bridge.copy()
        for connector in list(machine.connectors)[: number % 4]:
            machine.act("remove_block", {"block_id": connector})
        made.append(machine)
    return [*made[:-1], Machine()]


@pytest.mark.ci
def test_results_come_in_order_whatever_the_number_of_processes(short, bridge) -> None:
    machines = variants(bridge, 7)
    with Evaluator(short, processes=1) as one, Evaluator(short, processes=3) as three:
        alone = [found.trial.score for found in one.map(machines)]
        apart = [found.trial.score for found in three.map(reversed(machines))]
        assert one.evaluate(bridge.to_document()).trial.score == alone[0]
        with pytest.raises(DocumentError):
            one.evaluate({"no": "machine"})
    assert alone == apart[::-1]
    assert alone == [try_machine(short, machine).score for machine in machines]
    assert alone[-1].indicator == 0.0


@pytest.mark.ci
def test_a_trial_that_takes_too_long_is_broken_off(bridge) -> None:
    with Evaluator("support-1", processes=1, timeout_s=0.2) as evaluator:
        evaluator.processes[0].start()
        started = time.monotonic()
        assert evaluator.evaluate(bridge).error == "the trial took longer than 0.2 s"
        assert time.monotonic() - started < 60


def test_machines_are_taken_as_they_are_needed_and_stopping_early_leaves_nothing(short) -> None:
    taken = []

    def endless():
        while True:
            taken.append(len(taken))
            yield Machine()

    with Evaluator(short, processes=1) as evaluator:
        found = evaluator.map(endless())
        assert [next(found).trial.reason for _ in range(3)] == ["empty_machine"] * 3
        found.close()
        assert len(taken) < 20
        assert evaluator.evaluate(Machine()).trial is not None


@pytest.mark.ci
def test_a_trial_that_ends_when_it_is_decided_has_the_same_verdict(bridge) -> None:
    task = builtin_tasks()["support-1"]
    weak = bridge.copy()
    for connector in list(weak.connectors):
        weak.act("remove_block", {"block_id": connector})
    for machine in (bridge, weak):
        whole, ended = (try_machine(task, machine, to_end=how) for how in (True, False))
        assert ended.score == whole.score
        falls = whole.score.metrics["fall_time_s"]
        length = len(ended.trajectory.time_s)
        assert ended.trajectory.time_s[-1] == pytest.approx(falls + 1.0)
        assert ended.trajectory.breaks[-1].time_s <= falls + 1e-6
        for trial in (ended, whole):
            assert decided_length(task, trial.trajectory) == length < len(whole.trajectory.time_s)


def children() -> list[psutil.Process]:
    return [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]


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
