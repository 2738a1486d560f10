"""Trials in notebooks are those of the libraries: the same scores, in the order asked for."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import buildarena as ba
from buildarena import trials
from buildarena_benchmark import builtin_tasks, score
from buildarena_environment import Evaluator
from buildarena_simulation import SimulationError, simulate

ROOT = Path(__file__).parents[2]
ROW = "Small Wooden Block"


def row(each_side: int) -> ba.Machine:
    machine = ba.Machine()
    machine.start()
    for face in "EF":
        base = "1"
        for _ in range(each_side):
            base = machine.attach_block_to(base, face if base == "1" else "E", ROW).changed[0]
    return machine


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_trial_has_the_score_of_the_libraries(engine):
    machine, task = row(3), builtin_tasks()["support-1"]
    expected = score(task, machine, simulate(machine, task.scenario, engine, seed=3))
    for chosen in ("support-1", task):
        trial = ba.simulate(machine, chosen, engine=engine, seed=3)
        assert trial.score == expected
        assert trial.trajectory.engine == engine
        assert (trial.refusal, trial.task) == (None, task)


@pytest.mark.ci
def test_a_trial_keeps_the_machine_as_it_was():
    machine = row(3)
    trial = ba.simulate(machine, "support-1")
    assert machine.remove_block("7")
    assert len(trial.machine.blocks) == 7


def test_what_a_task_does_not_allow_is_a_failure_that_says_why(subtests):
    for machine, words in [
        (ba.Machine(), "no machine was started"),
        (row(0), "nothing but its starting block"),
    ]:
        with subtests.test(machine=machine):
            trial = ba.simulate(machine, "support-1")
            assert (trial.score.success, trial.score.indicator, trial.trajectory) == (
                False,
                0.0,
                None,
            )
            assert words in trial.refusal
            assert f"Not tried: {trial.refusal}" in repr(trial)
            assert "Not tried" in trial._repr_mimebundle_()["text/html"]


@pytest.mark.ci
def test_many_trials_come_in_the_order_of_the_machines():
    machines = [row(3), ba.Machine(), row(2), row(3)]
    alone = [ba.simulate(machine, "support-1") for machine in machines]
    for processes in (1, 2):
        together = ba.simulate_all(machines, "support-1", processes=processes)
        assert [trial.score for trial in together] == [trial.score for trial in alone]
        for one, other in zip(together, alone, strict=True):
            assert one.refusal == other.refusal
            if other.trajectory is not None:
                assert np.array_equal(one.trajectory.positions, other.trajectory.positions)
    loads = [trial.score.metrics["load_when_decided"] for trial in alone if not trial.refusal]
    assert loads[0] > loads[1]


def test_a_trial_that_is_broken_off_is_no_score(monkeypatch):
    monkeypatch.setattr(trials, "Evaluator", partial(Evaluator, timeout_s=0.001))
    with pytest.raises(SimulationError, match="machine 0 could not be tried"):
        ba.simulate_all([row(3)], "support-1", processes=1)


def test_nonsense_is_refused_with_the_choices(tmp_path):
    for call in (ba.simulate, lambda machine, *given: ba.simulate_all([machine], *given)):
        with pytest.raises(ValueError, match="no engine 'mujocco'; there are pybullet, mujoco"):
            call(row(0), "support-1", "mujocco")
        with pytest.raises(ValueError, match=r"no task 'support-9'; there are .*support-1"):
            call(row(0), "support-9")
        with pytest.raises(ValueError, match="no task"):
            call(row(0), tmp_path)
    with pytest.raises(ValueError, match="processes is 0"):
        ba.simulate_all([], "support-1", processes=0)
    assert ba.simulate_all([], "support-1") == []


def test_a_task_file_is_a_task():
    trial = ba.simulate(row(3), ROOT / "examples/tasks/suspension-bridge.yaml")
    assert trial.refusal is not None
    assert "constraint_violated" in trial.refusal


def test_tasks_are_listed():
    known = ba.tasks()
    assert list(known) == list(builtin_tasks())
    assert repr(known).splitlines()[3] == "support-1     A bridge over a gap of 5"
    assert "<td>support-1</td>" in known._repr_mimebundle_()["text/html"]
    with pytest.raises(KeyError):
        _ = known["support-9"]
