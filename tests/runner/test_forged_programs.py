"""Trials of programs in drawn worlds that a runner sends: what is refused before it is scored."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.machines.piloted import experts_machine

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine
from buildarena_pipeline.runtime.trajectory_files import OutcomeRefusedError
from buildarena_pipeline.runtime.trial_checks import checked_trajectory
from buildarena_simulation import SIMULATION_VERSION, Trajectory, simulate, write_trajectory

TASK = builtin_tasks()["landing-1"]
SEED = 7


@pytest.fixture(scope="module")
def machine() -> Machine:
    return experts_machine(TASK)


@pytest.fixture(scope="module")
def honest(machine) -> Trajectory:
    return simulate(machine, TASK.scenario, "mujoco", seed=SEED)


def checked(data: bytes, machine: Machine, seed: int | None = SEED) -> Trajectory:
    return checked_trajectory(
        data,
        simulator="mujoco",
        version=SIMULATION_VERSION,
        machine=machine,
        scenario=TASK.scenario,
        seed=seed,
    )


def piloting(**changes: Callable) -> Callable[[Trajectory], Trajectory]:
    """A forgery of what was sensed and asked for."""

    def forged(trajectory: Trajectory) -> Trajectory:
        told = trajectory.piloting
        made = {name: change(getattr(told, name)) for name, change in changes.items()}
        return replace(trajectory, piloting=replace(told, **made))

    return forged


def with_one(array: np.ndarray, value: float) -> np.ndarray:
    made = array.copy()
    made[3, 0] = value
    return made


def test_an_honest_trial_passes(honest, machine) -> None:
    again = checked(write_trajectory(honest), machine)
    assert np.array_equal(again.piloting.answers, honest.piloting.answers)


@pytest.mark.parametrize(
    ("forge", "told"),
    [
        (lambda t: replace(t, piloting=None), "schema is '3', not 4"),
        (piloting(answers=lambda a: with_one(a, 1.5)), "an answer is no share"),
        (piloting(answers=lambda a: with_one(a, -0.1)), "an answer is no share"),
        (piloting(answers=lambda a: with_one(a, np.nan)), "an answer is no share"),
        (piloting(answers=lambda a: a.astype(np.float64)), "answers is not of type float32"),
        (piloting(senses=lambda a: a.astype(np.float64)), "senses is not of type float32"),
        (piloting(sense_names=lambda n: (n[1], *n[1:])), "comes twice"),
        (piloting(action_names=lambda n: (n[1], *n[1:])), "comes twice"),
        (piloting(sense_names=lambda n: ("x" * 500, *n[1:])), "or a long one"),
        (piloting(sense_names=lambda n: (3, *n[1:])), "has no name"),
        (
            piloting(
                senses=lambda a: np.tile(a, (1, 500)),
                sense_names=lambda n: tuple(f"{k}" for k in range(500 * len(n))),
            ),
            "a trajectory of this machine has fewer",
        ),
        (lambda t: replace(t, settings={**t.settings, "controller": "0" * 64}), "controller"),
        (lambda t: replace(t, settings={**t.settings, "seed": 8}), "settings.seed"),
    ],
)
def test_what_is_said_of_a_program_is_bounded_and_sound(honest, machine, forge, told) -> None:
    with pytest.raises(OutcomeRefusedError) as caught:
        checked(write_trajectory(forge(honest)), machine)
    assert told in str(caught.value)


@pytest.mark.ci
def test_a_trial_in_an_easier_world_is_not_that_of_the_seed(machine, honest) -> None:
    """The world of another seed, said to be this one's: it starts elsewhere."""
    for seed in (None, 8):
        other = simulate(machine, TASK.scenario, "mujoco", seed=seed)
        forged = replace(other, settings={**other.settings, "seed": SEED})
        with pytest.raises(OutcomeRefusedError, match="start"):
            checked(write_trajectory(forged), machine)
    with pytest.raises(OutcomeRefusedError, match=r"settings\.seed"):
        checked(write_trajectory(honest), machine, seed=None)


@pytest.mark.ci
def test_keys_have_sensed_nothing(honest, machine) -> None:
    by_keys = machine.with_controller("")
    keys = simulate(by_keys, TASK.scenario, "mujoco", seed=SEED)
    assert checked(write_trajectory(keys), by_keys).piloting is None
    forged = replace(keys, piloting=honest.piloting)
    with pytest.raises(OutcomeRefusedError, match="schema is '4', not 3"):
        checked(write_trajectory(forged), by_keys)
