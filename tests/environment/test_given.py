"""Tasks that give a machine: it is drawn by the seed, and changes beyond its edits are refused."""

from dataclasses import replace

import pytest
from support.machines.expert_calls import calls_of, played

from buildarena_benchmark import builtin_tasks, parse_task
from buildarena_benchmark.families.given import edits_between
from buildarena_environment import ASSEMBLY, Environment
from buildarena_environment.choices import reference_of
from buildarena_environment.trial_pool import task_from, text_of

TASK = "repair-1"
LOOK = "get_machine_summary"


def test_the_seed_draws_the_machine_that_stands_there() -> None:
    told = [Environment(TASK, seed=seed).step(LOOK).feedback for seed in (None, 0, 1, 2)]
    assert told[0] == told[1]
    assert len(set(told)) == 3
    environment = Environment(TASK)
    environment.reset(seed=2)
    assert environment.step(LOOK).feedback == told[3]
    environment.reset()
    assert environment.step(LOOK).feedback == told[3]


def test_it_is_told_that_a_machine_stands_there_and_that_keys_are_pressed_already() -> None:
    text = Environment(TASK).observation.briefing
    assert "A machine stands in `main` already" in text
    assert "You write the key presses" not in text
    assert "A machine stands in" not in Environment("transport-1").observation.briefing


def test_an_edit_too_many_is_refused_with_the_number_and_changes_nothing() -> None:
    environment = Environment(TASK, seed=1)
    assert environment.step(LOOK).ok
    machine = environment.machines["main"]
    given = machine.copy()
    wheels = [block.id for block in machine.blocks.values() if block.module.spins]
    for wheel in wheels[:4]:
        assert environment.step("flip_spin", {"block_id": wheel}).ok
    before = machine.copy()
    for tool in ("flip_spin", "remove_block"):
        refused = environment.step(tool, {"block_id": wheels[4]})
        assert not refused.ok
        assert "by 5 edits, the task allows 4" in refused.feedback
    assert machine == before
    assert environment.step("flip_spin", {"block_id": wheels[0]}).ok, "undone"
    assert environment.step("flip_spin", {"block_id": wheels[4]}).ok
    assert edits_between(given, machine) == 4


@pytest.mark.parametrize(
    ("tool", "arguments"),
    [
        ("reset", {}),
        ("add_control_sequence", {"time": 1, "key": "UpArrow", "hold_for": 1}),
        ("reset_control_sequence", {}),
        ("remove_control_sequence", {"index": 0}),
    ],
)
def test_neither_a_new_beginning_nor_other_presses_are_taken(tool, arguments) -> None:
    environment = Environment(TASK)
    environment.step(LOOK)
    given = environment.machines["main"].copy()
    assert not environment.step(tool, arguments).ok
    assert environment.machines["main"] == given


def test_an_assembly_of_copies_is_refused() -> None:
    environment = Environment(TASK)
    environment.step(LOOK)
    added = environment.step("add_machine", {"machine_id": "main"}, machine=ASSEMBLY)
    assert not added.ok


def test_the_seeds_own_repair_succeeds_and_anothers_does_not() -> None:
    done = played(Environment(TASK, simulator="mujoco", seed=5), calls_of(TASK, 5)).submit()
    assert (done.trial.score.success, done.trial.score.indicator) == (True, 1.0)
    other = Environment(TASK, simulator="mujoco", seed=6)
    for call in calls_of(TASK, 5):
        other.step(call["tool"], call["arguments"], machine=call["machine"])
    assert not other.submit().trial.score.success


def test_a_drawn_task_comes_through_text_as_it_is() -> None:
    known = builtin_tasks()[TASK]
    own = replace(known, name="own-repair")
    for task in (known, known.drawn(7), own, own.drawn(8), builtin_tasks()["support-1"]):
        again = task_from(text_of(task))
        assert (again.name, again.seed, again.beginning) == (task.name, task.seed, task.beginning)
    assert parse_task(text_of(own), origin="x").version == known.version
    assert reference_of(known.drawn(7)) == reference_of(known)


def test_where_nothing_is_given_a_seed_draws_nothing() -> None:
    task = builtin_tasks()["support-1"]
    assert task.drawn(5) is task
