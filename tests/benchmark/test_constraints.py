"""What a task allows is checked on the finished machine."""

from itertools import pairwise

import pytest
import yaml
from support.machines.building import BLOCK, built, connect

from buildarena_benchmark import Task, broken_constraint, load_task
from buildarena_geometry import Machine


def task_with(tasks: dict[str, Task], **constraints: object) -> Task:
    document = dict(tasks["support-1"].as_document()) | {"constraints": constraints}
    return load_task(yaml.safe_dump(document))


def row(length: int) -> Machine:
    """Blocks in a row to the north, the starting block included."""
    return built(*((str(number), "E", BLOCK) for number in range(1, length)))


def assembly(*lengths: int, joined: bool = True, connector: str = "Brace") -> Machine:
    """Rows of blocks side by side, joined from one to the next."""
    machine = Machine(available={f"row {n}": row(n) for n in lengths})
    for place, length in enumerate(lengths):
        shift = [3 * place, 0, 0]
        done = machine.act("add_machine", {"machine_id": f"row {length}", "init_shift": shift})
        assert done.ok, done.text
    letters = list(machine.sub_structures)
    for one, other in pairwise(letters if joined else ()):
        ends = {"block_a": f"{one}_1", "face_a": "A", "block_b": f"{other}_1", "face_b": "B"}
        done = machine.act("connect_blocks", {**ends, "connector": connector})
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
    says = "sub-structure B has 5 blocks, the task allows 4 in one"
    assert broken_constraint(task, assembly(3, 5)) == ("constraint_violated", says)


def test_copies_count_against_the_blocks_of_all(tasks) -> None:
    task = task_with(tasks, max_sub_structures=2, max_blocks=4)
    says = "the machine has 11 blocks, the task allows 8 in all"
    assert broken_constraint(task, assembly(4, 4, 3)) == ("constraint_violated", says)


def test_connectors_are_no_blocks(tasks) -> None:
    machine = row(4)
    done = connect(machine, "2", "A", "4", "A", connector="Winch")
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


@pytest.mark.parametrize(
    ("least", "most", "lengths", "says"),
    [
        (1, 1, (3,), None),
        (1, 1, (3, 4), "has 2 sub-structures, the task asks for 1"),
        # One piece means one, however often it is copied.
        (1, 1, (3, 3), "has 2 sub-structures, the task asks for 1"),
        (1, 3, (3, 4, 5), None),
        (1, 3, (3, 3, 4, 4), None),  # copies count once
        (1, 3, (2, 3, 4, 5), "has 4 sub-structures, the task asks for 1 to 3"),
        (2, 2, (3, 4), None),
        # An engine and three copies of a frame, or two copies of one thing.
        (2, 2, (3, 4, 4, 4), None),
        (2, 2, (3, 3), None),
        (2, 2, (3, 4, 5), "has 3 sub-structures, the task asks for 2"),
        (2, 2, (3, 1), "sub-structure B is nothing but its starting block"),
    ],
)
def test_sub_structures_are_counted_on_the_machine(tasks, least, most, lengths, says) -> None:
    task = task_with(tasks, min_sub_structures=least, max_sub_structures=most)
    broken = broken_constraint(task, assembly(*lengths))
    if says is None:
        assert broken is None
    else:
        assert broken is not None
        assert broken[0] == "constraint_violated"
        assert broken[1].endswith(says)


def test_a_machine_built_in_one_go_is_one_sub_structure(tasks) -> None:
    assert broken_constraint(tasks["support-1"], row(4)) is None
    says = "the machine has 1 sub-structure, the task asks for 2"
    assert broken_constraint(tasks["lift-3"], row(4)) == ("constraint_violated", says)


def test_a_sub_structure_that_was_removed_does_not_count(tasks) -> None:
    machine = assembly(3, 4)
    assert machine.act("remove_machine", {"machine_index": "B"}).ok
    assert broken_constraint(tasks["support-1"], machine) is None
    assert broken_constraint(tasks["lift-3"], machine) is not None


@pytest.mark.parametrize("connector", ["Brace", "Winch"])
def test_sub_structures_must_be_joined(tasks, connector) -> None:
    assert broken_constraint(tasks["support-2"], assembly(3, 4, connector=connector)) is None
    broken = broken_constraint(tasks["support-2"], assembly(3, 4, joined=False))
    assert broken is not None
    reason, sentence = broken
    assert reason == "unjoined_parts"
    assert sentence == (
        "sub-structure B is not joined to the starting block A_1: join every part by an "
        "attachment that holds or a connector"
    )


def test_an_unjoined_sub_structure_is_named_with_single_blocks(tasks) -> None:
    machine = assembly(3, 4, joined=False)
    assert machine.act("remove_block", {"block_id": "A_2"}).ok
    broken = broken_constraint(tasks["support-2"], machine)
    assert broken is not None
    assert broken[1].startswith("sub-structure B and block A_3 (Small Wooden Block) are not joined")


@pytest.mark.parametrize("shifts", [1, 2, 3])
def test_a_block_that_was_shifted_off_its_place_is_unjoined(tasks, shifts) -> None:
    machine = row(4)
    for _ in range(shifts):
        done = machine.act("shift_block", {"block_id": "4", "shift_real": [0.5, 0, 0]})
        assert done.ok, done.text
    for task in tasks.values():
        if task.constraints.min_modules or task.beginning:
            continue
        broken = broken_constraint(task, machine)
        if shifts == 1 and task.name != "lift-3":  # half a unit still holds
            assert broken is None
        elif task.name != "lift-3":
            assert broken is not None
            assert broken[0] == "unjoined_parts"
            assert broken[1].startswith("block 4 (Small Wooden Block) is not joined to the start")
    assert connect(machine, "4", "C", "3", "C").ok
    assert broken_constraint(tasks["support-1"], machine) is None


def test_a_connector_from_a_block_to_itself_joins_nothing(tasks) -> None:
    machine = row(3)
    assert machine.act("remove_block", {"block_id": "2"}).ok
    assert connect(machine, "3", "C", "3", "D").ok
    broken = broken_constraint(tasks["support-1"], machine)
    assert broken is not None
    assert "block 3 (Small Wooden Block)" in broken[1]


def test_many_unjoined_blocks_are_counted_not_listed(tasks) -> None:
    machine = row(20)
    assert machine.act("remove_block", {"block_id": "2"}).ok
    broken = broken_constraint(tasks["support-1"], machine)
    assert broken is not None
    assert "and 8 more are not joined" in broken[1]
