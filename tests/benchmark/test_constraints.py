"""What a task allows is checked on the finished machine."""

from __future__ import annotations

import pytest
import yaml

from buildarena_benchmark import Task, broken_constraint, load_task
from buildarena_geometry import Machine


def task_with(tasks: dict[str, Task], **constraints: object) -> Task:
    document = dict(tasks["support-1"].as_document()) | {"constraints": constraints}
    return load_task(yaml.safe_dump(document))


def row(length: int) -> Machine:
    """Blocks in a row to the north, the starting block included."""
    machine = Machine()
    assert machine.act("start").ok
    for number in range(1, length):
        done = machine.act(
            "attach_block_to",
            {"base_block": str(number), "face": "E", "new_block": "Small Wooden Block"},
        )
        assert done.ok, done.text
    return machine


def assembly(*lengths: int) -> Machine:
    """Rows of blocks side by side."""
    machine = Machine(available={f"row {n}": row(n) for n in lengths})
    for place, length in enumerate(lengths):
        shift = [3 * place, 0, 0]
        done = machine.act("add_machine", {"machine_id": f"row {length}", "init_shift": shift})
        assert done.ok, done.text
    return machine


def test_a_machine_without_anything_built_is_empty(tasks) -> None:
    for machine in (Machine(), row(1)):
        broken = broken_constraint(tasks["support-1"], machine)
        assert broken is not None
        assert broken[0] == "empty_machine"


def test_each_sub_structure_may_have_its_blocks(tasks) -> None:
    task = task_with(tasks, max_sub_structures=2, max_blocks=4)
    assert broken_constraint(task, assembly(4, 4)) is None
    assert broken_constraint(task, assembly(3, 5)) == (
        "constraint_violated",
        "sub-structure B has 5 blocks, the task allows 4 in one",
    )


def test_copies_count_against_the_blocks_of_all(tasks) -> None:
    task = task_with(tasks, max_sub_structures=2, max_blocks=4)
    assert broken_constraint(task, assembly(4, 4, 3)) == (
        "constraint_violated",
        "the machine has 11 blocks, the task allows 8 in all",
    )


def test_connectors_are_no_blocks(tasks) -> None:
    machine = row(4)
    ends = {"block_a": "2", "face_a": "A", "block_b": "4", "face_b": "A", "connector": "Winch"}
    done = machine.act("connect_blocks", ends)
    assert done.ok, done.text
    assert broken_constraint(task_with(tasks, max_blocks=4), machine) is None
    assert broken_constraint(task_with(tasks, max_blocks=3), machine) is not None


@pytest.mark.parametrize(
    ("constraints", "says"),
    [
        ({"modules": ["Small Wooden Block"]}, None),
        ({"modules": ["Brace"]}, "Small Wooden Block is not among the task's modules"),
        ({"min_modules": {"Small Wooden Block": 3}}, None),
        (
            {"min_modules": {"Small Wooden Block": 3, "Winch": 2}},
            "the machine has 0 of Winch, the task asks for 2 or more",
        ),
    ],
)
def test_modules_are_those_that_the_task_names(tasks, constraints, says) -> None:
    broken = broken_constraint(task_with(tasks, **constraints), row(4))
    assert broken == (None if says is None else ("constraint_violated", says))
