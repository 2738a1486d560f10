"""The families `repair` and `identify`: what counts, what is refused, and what earns nothing."""

from dataclasses import replace
from importlib import resources

import pytest
from support.machines.building import KeyedDraft
from support.machines.repairs import faulty, new_car, repaired, wheels_of
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark import (
    Task,
    TaskError,
    broken_constraint,
    builtin_tasks,
    parse_task,
    score,
)
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Direction
from buildarena_benchmark.families.cars import FAULTS, sample_car
from buildarena_benchmark.families.initial_machine import edits_between, make_reference_machine
from buildarena_geometry import Machine
from buildarena_simulation import simulate


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, *(nightly(seed) for seed in range(1, 12))])
def test_a_faulty_car_fails_and_the_whole_one_drives_straight(engine, tasks, seed) -> None:
    task = tasks["repair-1"].with_seed(seed)
    result, _ = trial(task, faulty(task), engine)
    assert broken_constraint(task, faulty(task)) is None
    assert (result.success, result.indicator) == (False, 0.0), result
    result, _ = trial(task, make_reference_machine(task.initial_machine, seed), engine)
    assert (result.success, result.indicator, result.flags) == (True, 1.0, ())


def test_a_repaired_car_stays_straight_in_another_world(engine, tasks) -> None:
    task = tasks["repair-1"].with_seed(4)
    machine = repaired(task)
    assert broken_constraint(task, machine) is None
    result = score(task, machine, simulate(machine, task.scenario, engine, seed=11))
    assert (result.success, result.indicator, result.flags) == (True, 1.0, ())


@pytest.mark.nightly(engine="pybullet")
def test_a_fault_that_stays_keeps_it_from_driving_straight(engine, tasks) -> None:
    task = tasks["repair-1"].with_seed(1)
    result, _ = trial(task, repaired(task, count=1), engine)
    assert not result.success


def test_a_car_that_is_thrown_far_is_not_driven(engine, tasks) -> None:
    """Where its keys are never pressed, nothing that happens to it counts."""
    task = tasks["repair-1"].with_seed(0)
    machine = make_reference_machine(task.initial_machine, 0)
    path = simulate(machine, task.scenario, engine, controls=())
    thrown = path.positions.copy()
    thrown[:, :, 1] += 10.0 * path.time_s[:, None].astype(thrown.dtype)
    result = score(task, machine, replace(path, positions=thrown))
    assert (result.success, result.indicator) == (False, 0.0)
    assert "not_driven" in result.flags


def test_a_car_has_one_fault_of_each_kind_and_each_is_one_edit(tasks) -> None:
    given, wheels, sizes = tasks["repair-1"].initial_machine, set(), set()
    for seed in range(30):
        car = sample_car(seed, given.faults)
        assert sorted(wheel.fault for wheel in car.wheels) == ["", *sorted(FAULTS)]
        wheels.update((wheel.side, wheel.fault) for wheel in car.wheels)
        sizes.add((len(car.blocks), [wheel.fault for wheel in car.wheels].index("missing")))
        task = tasks["repair-1"].with_seed(seed)
        assert edits_between(faulty(task), repaired(task)) == given.faults
    assert len(wheels) == 12
    assert len(sizes) > 8


def test_what_is_undone_is_no_edit_and_what_is_put_back_is_two(tasks) -> None:
    task = tasks["repair-1"].with_seed(0)
    given, machine = faulty(task), faulty(task)
    wheel = wheels_of(machine, 1)[0]
    for count in (1, 0, 1):
        machine.act("flip_spin", {"block_id": wheel.id})
        assert edits_between(given, machine) == count
    machine.act("flip_spin", {"block_id": wheel.id})
    base, face = wheel.mount
    machine.act("remove_block", {"block_id": wheel.id})
    assert edits_between(given, machine) == 1
    machine.act("attach_block_to", {"base_block": base, "face": face, "new_block": "Powered Wheel"})
    assert edits_between(given, machine) == 2
    reason, sentence = broken_constraint(task, new_car()) or ("", "")
    assert (reason, "edits, the task allows 6" in sentence) == ("constraint_violated", True)


TASK = builtin_tasks()["identify-1"]


FAN, GRABBER = "Flying Block", "Grabber"


WAYS: tuple[Direction, ...] = (EAST, WEST, NORTH, SOUTH)


def with_rise(rise: float) -> Task:
    """The task in its file's world, with another rise."""
    return replace(TASK, scoring=TASK.scoring.model_copy(update={"rise": rise}))


def flyer(hold_s: float, *, arms: int = 3, weak: bool = False) -> Machine:
    """A cross of fans with a grabber; `weak` hangs something on that comes off."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    gripper = draft.attach(middle, DOWN, GRABBER)
    draft.bind(gripper, "grab", "Alpha9")
    for side in WAYS:
        arm = draft.row(middle, side, arms)
        draft.row(arm[1], DOWN, 2)
        for block in arm:
            draft.bind(draft.attach(block, UP, FAN), "fly", "Alpha1")
        if weak:
            loose = draft.attach(arm[-1], side, "Decoupler")
            draft.bind(loose, "decouple", "Alpha2")
    draft.press("Alpha1", 0.5, hold_s)
    if weak:
        draft.press("Alpha2", 1.0, 0.1)
    return draft.machine


@pytest.mark.nightly(engine="pybullet")
def test_an_honest_flight_counts_by_how_near_it_comes(engine) -> None:
    machine = flyer(1.5)
    first, path = trial(with_rise(60), machine, engine, duration_s=10)
    rise = first.metrics["rise"]
    assert rise > 10
    for off, success in ((0.0, True), (1.5, True), (3.5, False), (-3.5, False), (11.0, False)):
        result = score(with_rise(rise + off), machine, path)
        assert result.success is success
        assert result.indicator == pytest.approx(max(0.0, 1 - abs(off) / 5), abs=0.01)
        assert result.flags == ()


@pytest.mark.nightly(engine="pybullet")
def test_parts_that_come_off_on_the_way_up_are_told_of(engine) -> None:
    machine = flyer(1.5, weak=True)
    first, path = trial(with_rise(60), machine, engine, duration_s=10)
    result = score(with_rise(first.metrics["rise"]), machine, path)
    assert (result.success, result.indicator, result.flags) == (False, 0.0, ("came_apart",))


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("length", [10, nightly(6), nightly(14)])
def test_a_lever_that_turns_over_on_the_ground_does_not_count(engine, length) -> None:
    """Its highest point is its length, in whichever world: no number need be known for it."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    gripper = draft.attach(middle, DOWN, GRABBER)
    draft.bind(gripper, "grab", "Alpha9")
    arm = draft.row(middle, NORTH, length)
    for side in (EAST, WEST):
        draft.row(draft.row(arm[-1], side, 3)[-1], DOWN, 2)
    draft.row(arm[-1], DOWN, 2)
    for block in (middle, *arm[:3]):
        draft.bind(draft.attach(block, UP, FAN), "fly", "Alpha1")
    draft.press("Alpha1", 0.5, 4.0)
    machine = draft.machine
    first, path = trial(with_rise(60), machine, engine, drive_strength=3.0, duration_s=10)
    rise = first.metrics["rise"]
    result = score(with_rise(max(rise, 0.5)), machine, path)
    if result.flags == ("not_airborne",):
        assert (result.success, result.indicator) == (False, 0.0)
    else:  # it took off: then nothing of it is a lever
        assert result.metrics["top_s"] > 0.5


def test_files_that_nobody_could_play_are_refused() -> None:
    folder = resources.files("buildarena_benchmark.tasks") / "design"
    text = (folder / "identify-1.yaml").read_text()
    for was, becomes, says in (
        ("cargo: {size: [2, 2, 1], at: [0, 0, 0],", "cargo: {size: [2, 2, 1],", "cargo.at"),
        ("max_off: 3", "max_off: 12", "less than reach"),
        ("gravity: [20, 40]", "gravity: [40, 20]", "must be below"),
        ("gravity: [20, 40]", "gravity: [20, 400]", "gravity"),
        ("drive_strength: [0.8, 1.5]", "drive_strength: [0.8, 150]", "drive_strength"),
        ("test_trials: 3", "test_trials: 21", "test_trials"),
        ("control: {mode: agent}", "control: {mode: none}", "control"),
    ):
        assert was in text
        with pytest.raises(TaskError, match=says):
            parse_task(text.replace(was, becomes), origin="identify-1.yaml")
