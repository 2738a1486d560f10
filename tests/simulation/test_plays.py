"""Many trials of one machine in one process: each has the bytes of a trial by itself."""

import pytest
from support.machines.families import beam, car, rocket
from support.machines.references import load_machine

from buildarena_benchmark import Score, robustness, score
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import (
    MachineNotSimulable,
    Play,
    Scenario,
    Trajectory,
    UnknownEngineError,
    simulate,
    simulate_many,
    write_trajectory,
)
from buildarena_simulation.offered import Senses
from buildarena_simulation.scenario import Control

SHORT_S = 2.6
"""Long enough for the beam's cargo to land, and for the carrier to drive off."""


def written(outcome: Trajectory | MachineNotSimulable) -> bytes:
    assert isinstance(outcome, Trajectory), outcome
    return write_trajectory(outcome)


@pytest.mark.ci
@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("build", "task"),
    [
        (lambda: load_machine("beam"), "support-1"),
        (lambda: load_machine("carrier"), "transport-2"),
        (rocket, "lift-1"),
    ],
)
def test_each_trial_of_many_has_the_bytes_of_one_by_itself(engine, tasks, build, task) -> None:
    machine = build()
    scenario = tasks[task].scenario.model_copy(update={"duration_s": SHORT_S})
    pressed = (KeyPress(time_s=0.4, key="UpArrow", hold_for_s=0.8),)
    plays = [Play(seed=3), Play(), Play(seed=4), Play(controls=pressed), Play(seed=3)]
    many = [written(each) for each in simulate_many(machine, scenario, engine, plays=plays)]
    alone = [
        written(simulate(machine, scenario, engine, seed=play.seed, controls=play.controls))
        for play in plays
    ]
    assert many == alone
    assert many[0] == many[4]
    assert len(set(many)) > 2


def test_a_program_starts_anew_in_each_trial(engine) -> None:
    text = "local n = 0\nfunction control() n = n + 1 return { spinning_forward = n < 20 } end"
    machine = car().with_controller(text)
    scenario = Scenario(duration_s=1.0, control=Control(mode="agent"), senses=Senses())
    first, second, third = (
        written(each)
        for each in simulate_many(
            machine, scenario, engine, plays=[Play(), Play(controls=()), Play()]
        )
    )
    assert first == third == write_trajectory(simulate(machine, scenario, engine))
    assert first != second


def test_a_refused_trial_is_told_and_the_next_ones_go_on(engine, tasks) -> None:
    scenario = Scenario(duration_s=0.4, control=Control(mode="agent"), senses=Senses())
    machine = car().with_controller("function control() error('no') end")
    refused, driven = simulate_many(machine, scenario, engine, plays=[Play(), Play(controls=())])
    assert isinstance(refused, MachineNotSimulable)
    assert isinstance(driven, Trajectory)
    plays = [Play(seed=1), Play(seed=2)]
    empty = list(simulate_many(Machine(), tasks["lift-1"].scenario, engine, plays=plays))
    assert [str(each) for each in empty] == ["the machine has no blocks"] * 2


def test_no_trial_is_simulated_before_its_turn(engine) -> None:
    asked = []

    def plays():
        for seed in (1, 2):
            asked.append(seed)
            yield Play(seed=seed)

    outcomes = simulate_many(beam(3), Scenario(duration_s=0.2), engine, plays=plays())
    assert asked == []
    next(outcomes)
    assert asked == [1]


def test_an_unknown_engine_is_an_error_and_no_refusal() -> None:
    with pytest.raises(UnknownEngineError, match="havok"):
        next(simulate_many(beam(3), Scenario(duration_s=0.2), "havok", plays=[Play()]))


def test_robustness_has_the_scores_of_single_trials(engine, tasks) -> None:
    task, machine = tasks["lift-1"], rocket()
    done: list[float] = []
    found = robustness(task, machine, engine, (5, 6), on_progress=done.append)
    scores: list[Score] = [
        score(task, machine, simulate(machine, task.scenario, engine, seed=seed)) for seed in (5, 6)
    ]
    assert list(found.scores) == scores
    assert done == [0.5, 1.0]
