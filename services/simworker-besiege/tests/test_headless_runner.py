"""A game without a window, driven over TCP."""

import contextlib
import json
from collections.abc import Iterator
from dataclasses import replace

import pytest
from game_rig import VERSION, Rig, experts_machine, our_score, short_trial, trial_of

from buildarena_benchmark import builtin_tasks, score
from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.runtime.simulators.simulator import SimulatorFaultError
from buildarena_pipeline.runtime.trajectory_files import OutcomeRefusedError
from buildarena_pipeline.runtime.trial_checks import (
    checked_trajectory,
    checked_versions,
)
from buildarena_simulation import write_trajectory
from buildarena_simworker_besiege.headless import HeadlessDesktop
from buildarena_simworker_besiege.settings import BesiegeSettings
from buildarena_simworker_besiege.simulator import BesiegeSimulator

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(120)]


@pytest.fixture
def headless(rig: Rig, monkeypatch) -> Iterator[tuple[Rig, BesiegeSimulator]]:
    own = replace(rig, patience=0.3, speed=2.0)
    for name, value in own.environment().items():
        monkeypatch.setenv(name, value)
    words = own.environment()["BUILDARENA_BESIEGE_COMMAND"].replace("--level={level}", "--headless")
    monkeypatch.setenv("BUILDARENA_BESIEGE_COMMAND", words)
    monkeypatch.setenv("BUILDARENA_BESIEGE_DESKTOP", "headless")
    settings = BesiegeSettings()
    simulator = BesiegeSimulator(settings, HeadlessDesktop(settings), {"desktop": "headless"})
    yield own, simulator
    simulator.close()


def test_a_car_is_driven_as_by_our_engine(headless) -> None:
    rig, simulator = headless
    task, machine = short_trial("transport-1")
    for _ in range(2):  # the same game plays again
        done = simulator.run(trial_of(task, machine))
        right = our_score(task, machine)
        found = score(task, machine, done.trajectory)
        assert found.success == right.success
        assert found.indicator == pytest.approx(right.indicator, rel=0.05)  # five times a second
        assert not list(rig.machines.iterdir())
        # The API takes it from a runner that reaches nothing else.
        wanted = {"simulator": "besiege", "machine": machine, "scenario": task.scenario}
        sent = write_trajectory(done.trajectory)
        kept = checked_trajectory(sent, version=VERSION, **wanted)
        assert write_trajectory(kept) == sent
        checked_versions(
            done.versions, simulator="besiege", version=VERSION, trajectory=done.trajectory
        )
        with pytest.raises(OutcomeRefusedError, match="engine_version"):
            checked_trajectory(sent, version="1.0-1", **wanted)


@pytest.mark.parametrize("name", ["support-1", "transport-2", "lift-1", "lift-2"])
def test_what_needs_the_script_is_refused_with_the_reason(headless, name) -> None:
    task, machine = builtin_tasks()[name], experts_machine(name)
    with pytest.raises(PermanentError, match="runs no script"):
        headless[1].run(trial_of(task, machine))


@pytest.mark.parametrize("fault", ["crash", "freeze"])
def test_a_fault_once_is_got_over(headless, fault) -> None:
    rig, simulator = headless
    rig.faults.write_text(json.dumps([{"fault": fault, "at": "simulating", "after_s": 1.0}]))
    task, machine = short_trial("transport-1")
    done = simulator.run(trial_of(task, machine))
    assert done.versions["faults"]
    assert score(task, machine, done.trajectory).indicator > 1.0


@pytest.mark.usefixtures("headless")
def test_a_game_that_cannot_be_started_is_a_fault_with_a_sentence(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("BUILDARENA_BESIEGE_COMMAND", "/nowhere/besiege")
    monkeypatch.setenv("BUILDARENA_BESIEGE_STATE", str(tmp_path))
    settings = BesiegeSettings()
    simulator = BesiegeSimulator(settings, HeadlessDesktop(settings), {})
    task, machine = short_trial("transport-1")
    with (
        contextlib.closing(simulator),
        pytest.raises(SimulatorFaultError, match="cannot be started"),
    ):
        simulator.run(trial_of(task, machine))
