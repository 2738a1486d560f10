"""BesiegeField's levels as task files: they can be read, and the expert's designs solve some."""

import re
from pathlib import Path

import pytest
from support.machines.expert_calls import built
from support.machines.piloted import FASTER_FIRST

from buildarena_benchmark import Task, parse_custom_task, score
from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_worker.builtin.designs import LEVEL_DESIGNS

FOLDER = Path(__file__).parents[2] / "examples" / "tasks" / "besiegefield"
LEVELS = sorted(path.stem for path in FOLDER.glob("*.yaml"))
SOLVED = sorted(LEVEL_DESIGNS)


def level(name: str) -> Task:
    return parse_custom_task((FOLDER / f"{name}.yaml").read_text(), origin=name)


def experts_machine(task: Task) -> Machine:
    machine = task.new_machine(task.constraints.catalogue)
    return built(LEVEL_DESIGNS[task.name](0), machine)


def test_there_are_all_levels_of_the_four_families() -> None:
    families = {"car": 5, "catapult": 11, "delivery": 9, "fetch": 1}
    assert {
        f"besiegefield-{family}-{number}"
        for family, count in families.items()
        for number in range(1, count + 1)
    } == set(LEVELS)


def test_the_readme_tells_what_the_expert_solves() -> None:
    rows = [line for line in (FOLDER / "README.md").read_text().splitlines() if line[:3] == "| `"]
    told = [f"besiegefield-{name}" for row in rows for name in re.findall(r"`([^`]+)`", row)]
    assert sorted(told) == SOLVED


@pytest.mark.nightly(keep=6)
@pytest.mark.parametrize("name", LEVELS)
def test_each_can_be_read_and_a_machine_of_nothing_fails(name) -> None:
    task = level(name)
    assert task.name == name
    machine = task.new_machine(task.constraints.catalogue)
    assert machine.act("start", {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]}).ok
    trajectory = simulate(machine, task.scenario, "mujoco")
    failed = score(task, machine, trajectory)
    assert not failed.success
    assert failed.indicator < 0.5


@pytest.mark.ci
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("name", SOLVED)
def test_the_experts_design_solves_it(name, engine) -> None:
    task = level(name)
    machine = experts_machine(task)
    told = score(task, machine, simulate(machine, task.scenario, engine))
    assert told.success, told


def test_a_catapult_throws_five_times_as_far_as_the_best_published_mean() -> None:
    """A mean of 9.8 is published; its distance counts from the start, 11 before our line."""
    task = level("besiegefield-catapult-1")
    machine = experts_machine(task)
    told = score(task, machine, simulate(machine, task.scenario, "mujoco"))
    assert told.indicator + 11 > 5 * 9.83
