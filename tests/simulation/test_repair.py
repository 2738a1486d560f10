"""The family `repair`: the faulty car fails, the whole one does not, and tricks earn nothing."""

from dataclasses import replace

import pytest
from support.machines.repairs import TRICKS, faulty, faulty_side, new_car, repaired, wheels_of
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark import broken_constraint, score
from buildarena_benchmark.families.cars import drawn_car
from buildarena_benchmark.families.given import edits_between, given_machine, whole_machine
from buildarena_simulation import simulate


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, *(nightly(seed) for seed in range(1, 12))])
def test_a_faulty_car_fails_and_the_whole_one_drives_straight(engine, tasks, seed) -> None:
    task = tasks["repair-1"].drawn(seed)
    result, _ = trial(task, faulty(task), engine)
    assert broken_constraint(task, faulty(task)) is None
    assert (result.success, result.indicator) == (False, 0.0), result
    result, _ = trial(task, whole_machine(task.beginning, seed), engine)
    assert (result.success, result.indicator, result.flags) == (True, 1.0, ())


def test_a_repaired_car_stays_straight_in_another_world(engine, tasks) -> None:
    task = tasks["repair-1"].drawn(4)
    machine = repaired(task)
    assert broken_constraint(task, machine) is None
    result = score(task, machine, simulate(machine, task.scenario, engine, seed=11))
    assert (result.success, result.indicator, result.flags) == (True, 1.0, ())


@pytest.mark.nightly(keep=3)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("trick", TRICKS)
def test_what_finds_no_fault_regains_little(engine, tasks, trick, seed) -> None:
    task = tasks["repair-1"].drawn(seed)
    machine = TRICKS[trick](task)
    assert broken_constraint(task, machine) is None, "the edits suffice for it"
    result, _ = trial(task, machine, engine)
    assert not result.success
    assert result.indicator < 0.5


@pytest.mark.nightly(engine="pybullet")
def test_a_fault_that_stays_keeps_it_from_driving_straight(engine, tasks) -> None:
    task = tasks["repair-1"].drawn(1)
    result, _ = trial(task, repaired(task, count=1), engine)
    assert not result.success


def test_a_car_that_is_thrown_far_is_not_driven(engine, tasks) -> None:
    """Where its keys are never pressed, nothing that happens to it counts."""
    task = tasks["repair-1"].drawn(0)
    machine = whole_machine(task.beginning, 0)
    path = simulate(machine, task.scenario, engine, controls=())
    thrown = path.positions.copy()
    thrown[:, :, 1] += 10.0 * path.time_s[:, None].astype(thrown.dtype)
    result = score(task, machine, replace(path, positions=thrown))
    assert (result.success, result.indicator) == (False, 0.0)
    assert "not_driven" in result.flags


@pytest.mark.nightly(engine="pybullet")
def test_a_new_car_drives_straight_and_is_refused(engine, tasks) -> None:
    task = tasks["repair-1"].drawn(0)
    result, _ = trial(task, new_car(), engine)
    assert result.success, "it would count"
    reason, sentence = broken_constraint(task, new_car())
    assert reason == "constraint_violated"
    assert "edits, the task allows 4" in sentence


def test_all_faults_are_on_one_side_and_each_is_one_edit(tasks) -> None:
    given, sides, faults, sizes = tasks["repair-1"].beginning, set(), set(), set()
    for seed in range(30):
        car = drawn_car(seed, given.faults)
        wrong = [wheel for wheel in car.wheels if wheel.fault]
        assert len(wrong) == given.faults
        assert len({wheel.side for wheel in wrong}) == 1
        assert [wheel.fault for wheel in wrong].count("missing") <= 1
        assert {wheel.fault for wheel in wrong} & {"turned", "backward"}
        sides.add(wrong[0].side)
        faults.update(wheel.fault for wheel in wrong)
        sizes.add((len(car.blocks), len(car.wheels)))
        task = tasks["repair-1"].drawn(seed)
        assert edits_between(faulty(task), repaired(task)) == given.faults
    assert len(sides) == 2
    assert len(faults) == 5
    assert len(sizes) > 8


def test_what_is_undone_is_no_edit_and_what_is_put_back_is_two(tasks) -> None:
    task = tasks["repair-1"].drawn(0)
    given, machine = faulty(task), faulty(task)
    wheel = wheels_of(machine, -faulty_side(task))[0]
    for count in (1, 0, 1):
        machine.act("flip_spin", {"block_id": wheel.id})
        assert edits_between(given, machine) == count
    machine.act("flip_spin", {"block_id": wheel.id})
    base, face = wheel.mount
    machine.act("remove_block", {"block_id": wheel.id})
    assert edits_between(given, machine) == 1
    machine.act("attach_block_to", {"base_block": base, "face": face, "new_block": "Powered Wheel"})
    assert edits_between(given, machine) == 2


def test_its_log_tells_no_fault(tasks) -> None:
    """A machine's document holds the actions that built it: none of them takes anything away."""
    given = tasks["repair-1"].beginning
    for seed in range(10):
        names = {record.name for record in given_machine(given, seed).log}
        assert names <= {
            *("start", "attach_block_to", "flip_spin", "add_control_key"),
            "add_control_sequence",
        }
        flips = [r for r in given_machine(given, seed).log if r.name == "flip_spin"]
        assert len(flips) == len({record.arguments["block_id"] for record in flips})
