"""Sessions of tasks that give a machine."""

import pytest
from support.machines.repairs import faulty

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.families.given import edits_between


@pytest.mark.parametrize("workflow", ["five-role", "builder", "guidance-builder"])
@pytest.mark.parametrize("seed", [0, 9])
def test_builders_begin_with_the_machine_of_the_seed_and_nobody_drives(
    play, workflow, seed
) -> None:
    played = play("builtin/expert", task="repair-1", seed=seed, workflow=workflow)
    assert played.suspended is not None, played.failure
    task = builtin_tasks()["repair-1"].drawn(seed)
    assert edits_between(faulty(task), played.suspended.machine) == 3
    assert played.suspended.controls is None
    assert all(turn.role != "controller" for turn in played.session.transcript.turns)


def test_those_without_tools_are_told_the_machine(play) -> None:
    played = play("builtin/expert", task="repair-1", seed=3)
    task = builtin_tasks()["repair-1"].drawn(3)
    summary = faulty(task).act("get_machine_summary", {}).text
    assert summary in played.session.statement
    assert "UpArrow" in played.session.statement
    assert summary not in play("builtin/expert", task="repair-1", seed=4).session.statement


def test_an_idle_builder_leaves_it_as_it_is(play) -> None:
    played = play("builtin/idle", task="repair-1", workflow="builder")
    task = builtin_tasks()["repair-1"].drawn(0)
    if played.suspended is not None:
        assert edits_between(faulty(task), played.suspended.machine) == 0
