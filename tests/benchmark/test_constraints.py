"""What a task allows is checked on the finished machine."""

from itertools import pairwise

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
        assert machine.act("add_machine", {"machine_id": f"row {length}", "init_shift": shift}).ok
    letters = list(machine.state.structures)
    for one, other in pairwise(letters if joined else ()):
        assert connect(machine, f"{one}_1", "A", f"{other}_1", "B", connector=connector).ok
    return machine


def without(machine: Machine, *blocks: str) -> Machine:
    for block in blocks:
        assert machine.act("remove_block", {"block_id": block}).ok
    return machine


def test_blocks_modules_and_sub_structures_are_counted(tasks, subtests) -> None:
    rope = row(4)
    assert connect(rope, "2", "A", "4", "A", connector="Winch").ok
    removed = assembly(3, 4)
    assert removed.act("remove_machine", {"machine_index": "B"}).ok
    two = {"max_sub_structures": 2}
    needed = {"min_sub_structures": 2, **two}
    up_to_three = {"min_sub_structures": 1, "max_sub_structures": 3}
    for constraints, machine, says in (
        ({**two, "max_blocks": 4}, assembly(4, 4), None),
        ({**two, "max_blocks": 4}, assembly(3, 5), "B has 5 blocks, the task allows 4 in one"),
        ({**two, "max_blocks": 4}, assembly(4, 4, 3), "has 11 blocks, the task allows 8 in all"),
        ({"max_blocks": 4}, rope, None),  # connectors are not blocks
        ({"max_blocks": 3}, rope, "4 blocks, the task allows 3"),
        ({"modules": ["Small Wooden Block"]}, row(4), None),
        ({"modules": ["Brace"]}, row(4), "Small Wooden Block is not among the task's modules"),
        ({"min_modules": {"Small Wooden Block": 3}}, row(4), None),
        ({"min_modules": {"Winch": 2}}, row(4), "has 0 of Winch, the task asks for 2 or more"),
        ({}, assembly(3, 4), "has 2 sub-structures, the task asks for 1"),
        # One piece means one, however often it is copied.
        ({}, assembly(3, 3), "has 2 sub-structures, the task asks for 1"),
        ({}, removed, None),
        (up_to_three, assembly(3, 4, 5), None),
        (up_to_three, assembly(3, 3, 4, 4), None),  # copies count once
        (up_to_three, assembly(2, 3, 4, 5), "has 4 sub-structures, the task asks for 1 to 3"),
        # An engine and three copies of a frame, or two copies of one thing.
        (needed, assembly(3, 4, 4, 4), None),
        (needed, assembly(3, 3), None),
        (needed, row(4), "the machine has 1 sub-structure, the task asks for 2"),
        (needed, assembly(3, 4, 5), "has 3 sub-structures, the task asks for 2"),
        (needed, assembly(3, 1), "sub-structure B is nothing but its starting block"),
    ):
        with subtests.test(constraints=constraints, says=says):
            broken = broken_constraint(task_with(tasks, **constraints), machine)
            assert (broken is None) == (says is None), broken
            if says is not None:
                assert broken[0] == "constraint_violated"
                assert says in broken[1]


def test_what_is_empty_or_not_joined_is_named(tasks, subtests) -> None:
    far = without(row(3), "2")
    assert connect(far, "3", "C", "3", "D").ok  # from a block to itself
    apart = "sub-structure B is not joined to the starting block A_1: join every part by an attachm"
    singly = "sub-structure B and block A_3 (Small Wooden Block) are not joined"
    for name, machine, reason, says in (
        ("support-1", Machine(), "empty_machine", ""),
        ("support-1", row(1), "empty_machine", ""),
        ("support-2", assembly(3, 4, connector="Brace"), None, ""),
        ("support-2", assembly(3, 4, connector="Winch"), None, ""),
        ("support-2", assembly(3, 4, joined=False), "unjoined_parts", apart),
        ("support-2", without(assembly(3, 4, joined=False), "A_2"), "unjoined_parts", singly),
        ("support-1", far, "unjoined_parts", "block 3 (Small Wooden Block)"),
        ("support-1", without(row(20), "2"), "unjoined_parts", "and 8 more are not joined"),
    ):
        with subtests.test(says=says or name):
            broken = broken_constraint(tasks[name], machine)
            assert (broken and broken[0]) == reason
            assert says in (broken[1] if broken else "")


def test_a_block_that_was_shifted_off_its_place_is_unjoined(tasks) -> None:
    machine, found = row(4), []
    for _ in range(3):
        assert machine.act("shift_block", {"block_id": "4", "shift_real": [0.5, 0, 0]}).ok
        found.append(broken_constraint(tasks["support-1"], machine))
    assert found[0] is None, "half a unit still holds"
    for broken in found[1:]:
        assert broken[0] == "unjoined_parts"
        assert broken[1].startswith("block 4 (Small Wooden Block) is not joined to the start")
    assert connect(machine, "4", "C", "3", "C").ok
    assert broken_constraint(tasks["support-1"], machine) is None


def test_key_presses_are_bounded_and_no_two_connectors_are_one(tasks) -> None:
    for times, hold_s, message in (
        (2_001, 0.1, "2,001 key presses, at most 2,000"),
        (1, 1e5, "ends after 600 s"),
    ):
        machine = built(("1", "A", "Powered Wheel"))
        key = {"block_id": "2", "action": "spinning_forward", "new_key": "UpArrow"}
        assert machine.act("change_control_key", key).ok
        for _ in range(times):
            press = {"time": 0.0, "key": "UpArrow", "hold_for": hold_s}
            assert machine.act("add_control_sequence", press).ok
        assert message in broken_constraint(tasks["transport-1"], machine)[1]
    twice = row(4)
    for pair in (("1", "4"), ("4", "1")):
        assert connect(twice, pair[0], "C", pair[1], "C", connector="Brace").ok
    assert "joins the same faces" in broken_constraint(tasks["support-1"], twice)[1]


def test_more_than_the_most_of_a_module_is_refused(tasks) -> None:
    task = task_with(tasks, max_modules={"Brace": 1})
    machine = row(5)
    assert connect(machine, "1", "C", "4", "C", connector="Brace").ok
    assert broken_constraint(task, machine) is None
    assert connect(machine, "1", "D", "4", "D", connector="Brace").ok
    assert "2 of Brace, the task allows 1" in broken_constraint(task, machine)[1]
