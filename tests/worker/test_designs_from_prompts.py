"""What a model is told is enough to design by: a winch and an arm that work at the first try."""

import re
from dataclasses import replace

import pytest
from support.player import Played, Player
from support.providers.engineer import Engineer
from support.providers.flying_engineer import FlyingEngineer

from buildarena_benchmark import Task, builtin_tasks, score
from buildarena_simulation import ENGINES, simulate

TASKS = ["mechanisms-3", "mechanisms-4"]
OTHER_WINCHES = [(17, 6), (14, 6), (14, 7)]
"""Masses and distances of other cargoes."""


def built(task: Task, engineer: Engineer | None = None, **options: bool) -> Played:
    """A session of the stand-in, up to its first trial."""
    return Player()(task=task, client=engineer or Engineer(), workflow="builder", **options)


def first_try(task: Task, engine: str) -> bool:
    """Whether the first trial of a session succeeds."""
    played = built(task)
    assert played.suspended, played.failure
    controls = played.suspended.controls
    machine = played.suspended.machine
    return score(task, machine, simulate(machine, task.scenario, engine, controls=controls)).success


def another_winch(weight: float, north: float) -> Task:
    """The winch for another cargo, in words and in its trial."""
    task = builtin_tasks()["mechanisms-3"]
    statement, count = re.subn(r"weighs\s+20", f"weighs {weight}", task.statement)
    statement, moved = re.subn(r"\(0, 6, 0\)", f"(0, {north}, 0)", statement)
    assert (count, moved) == (1, 1)
    cargo = task.scenario.cargo.model_copy(
        update={"at": (0, north, 0), "initial_mass": weight, "final_mass": weight}
    )
    scenario = task.scenario.model_copy(update={"cargo": cargo})
    return replace(task, statement=statement, scenario=scenario)


@pytest.mark.ci
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", TASKS)
def test_numbers_in_the_prompt_are_enough_for_a_first_success(name, engine) -> None:
    assert first_try(builtin_tasks()[name], engine)


@pytest.mark.ci
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("weight", "north"), OTHER_WINCHES)
def test_other_numbers_make_other_machines_that_succeed_too(weight, north, engine) -> None:
    assert first_try(another_winch(weight, north), engine)


def test_without_data_sheets_nobody_can_compute_it(subtests) -> None:
    for name in TASKS:
        with subtests.test(name=name):
            played = built(builtin_tasks()[name], data_sheets=False)
            assert isinstance(played.result, LookupError)
            assert "does not say" in str(played.result)


def test_a_lighter_cargo_takes_fewer_motors() -> None:
    motors = [
        sum(block.module.name == "Cog Medium Powered" for block in machine.blocks.values())
        for machine in (built(another_winch(mass, 6)).suspended.machine for mass in (20, 14))
    ]
    assert motors == [4, 3]


@pytest.mark.ci
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("workflow", ["builder", "guidance-builder", "five-role"])
def test_the_words_on_programs_are_enough_to_land_in_any_world(workflow, engine) -> None:
    task = builtin_tasks()["landing-1"]
    played = Player()(task=task, client=FlyingEngineer(), workflow=workflow)
    assert played.suspended, played.failure
    assert played.suspended.controls is None
    machine = played.suspended.machine
    for seed in (None, 1, 2):
        trajectory = simulate(machine, task.scenario, engine, seed=seed)
        assert score(task, machine, trajectory).success, seed


def test_without_data_sheets_nobody_can_compute_how_to_fly() -> None:
    played = Player()(
        task="landing-1", client=FlyingEngineer(), workflow="builder", data_sheets=False
    )
    assert isinstance(played.result, LookupError)
    assert "does not say" in str(played.result)
