"""The tasks with headroom: what must not count, and honest machines beside the expert's that do."""

from dataclasses import replace

import pytest
from support.long_tests import long, slow_on_pybullet
from support.machines.headroom import boom_on_a_base, drafted, propped_beam
from support.machines.jet_cars import jet_car
from support.machines.swinging_bars import swinging_bar
from support.machines.trials import trial

from buildarena_benchmark import Task
from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.arms import swinging_arm
from buildarena_worker.builtin.designs.rovers import long_slalom_car, touring_car

# Support over 30 and 45

SPANS = [("support-4", 30), long("support-5", 45)]


@slow_on_pybullet
@pytest.mark.parametrize(("task", "gap"), SPANS)
@pytest.mark.parametrize("below", [{"places": (0,), "foot": 2}, {"places": (-6, 6)}])
def test_what_the_gaps_floor_bears_is_no_long_bridge(engine, tasks, task, gap, below) -> None:
    result, _ = trial(tasks[task], propped_beam(gap, **below), engine, duration_s=6.0)
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.metrics["load_per_mass"] == 0.0


@slow_on_pybullet
@pytest.mark.parametrize(("task", "gap"), SPANS)
@pytest.mark.parametrize("height", [3, 4])
def test_stilts_that_hang_over_the_floor_add_nothing(engine, tasks, task, gap, height) -> None:
    bare, stilted = (
        trial(tasks[task], propped_beam(gap, places, height=height, foot=1), engine, duration_s=8.0)
        for places in ((), (-3, 3))
    )
    assert stilted[0].indicator <= 1.05 * bare[0].indicator


@slow_on_pybullet
@pytest.mark.parametrize(("task", "gap"), SPANS)
def test_a_long_bridge_counts_and_tells_its_load_over_its_mass(engine, tasks, task, gap) -> None:
    machine = propped_beam(gap)
    result, _ = trial(tasks[task], machine, engine, duration_s=8.0)
    assert result.success, result
    assert result.flags == ()
    assert result.indicator > 100.0
    ratio = result.indicator / machine.mass
    assert result.metrics["load_per_mass"] == pytest.approx(ratio, abs=1e-5)


def test_only_the_tasks_that_ask_for_it_tell_the_load_over_the_mass(tasks) -> None:
    asking = {name for name, task in tasks.items() if "per_mass" in task.scoring.model_dump()}
    assert asking == {"support-4", "support-5"}


# A slalom of twelve gates


def test_a_car_that_drives_straight_on_passes_no_more_than_one_side(engine, tasks) -> None:
    for turn_s in (0.0, 0.02):
        steered = [(0.8, "RightArrow", turn_s), (1.2, "LeftArrow", turn_s)] if turn_s else []
        machine = drafted(long_slalom_car(0), [(0.3, "UpArrow", 29.0), *steered])
        result, _ = trial(tasks["mechanisms-5"], machine, engine, duration_s=22.0)
        assert not result.success
        assert result.metrics["gates"] <= 6


@slow_on_pybullet
@pytest.mark.parametrize("tip", ["bare", "heavy", "wheeled"])
def test_a_bar_that_swings_its_starting_block_passes_no_gate_by_it(engine, tasks, tip) -> None:
    machine = swinging_bar(tip, drive_s=1.6).machine
    result, _ = trial(tasks["mechanisms-5"], machine, engine, duration_s=12.0)
    assert not result.success
    assert result.metrics["gates"] <= 1, "the first gate's end is straight ahead"


@slow_on_pybullet
@pytest.mark.parametrize("wheels", ["braked", "backward", "tapped"])
def test_a_car_that_cannons_push_passes_no_gate(engine, tasks, wheels) -> None:
    result, _ = trial(tasks["mechanisms-5"], jet_car(wheels).machine, engine, duration_s=5.0)
    assert (result.success, result.indicator) == (False, 0.0)


# Placed to 0.3

ARM = [(1.0, "LeftArrow", 3.96), (9.0, "Alpha1", 0.2), (10.0, "RightArrow", 0.5)]


def _arm(*presses: tuple[float, str, float]) -> Machine:
    return drafted(swinging_arm(0), presses)


@slow_on_pybullet
@pytest.mark.parametrize(
    "presses",
    [
        ARM[:1],
        [ARM[0], (4.6, "Alpha1", 0.2), ARM[2]],
        [(1.0, "LeftArrow", 3.75), *ARM[1:]],
        [(1.0, "RightArrow", 0.3), (1.5, "Alpha1", 0.2)],
    ],
    ids=["never let go", "dropped on the way", "put down short", "kicked off"],
)
def test_a_cargo_that_is_not_put_down_within_the_mark_fails(engine, tasks, presses) -> None:
    result, _ = trial(tasks["mechanisms-6"], _arm(*presses), engine, duration_s=14.0)
    assert not result.success


@slow_on_pybullet
def test_an_arm_may_take_its_time(engine, tasks) -> None:
    machine = _arm((2.0, "LeftArrow", 3.96), (10.0, "Alpha1", 0.2), (11.0, "RightArrow", 0.4))
    result, _ = trial(tasks["mechanisms-6"], machine, engine, duration_s=20.0)
    assert result.success, result
    assert result.indicator == pytest.approx(1 / result.metrics["distance_to_mark"], rel=1e-4)


# Three stops


def _tour_of(tasks: dict[str, Task], *places: tuple[float, float]) -> Task:
    task = tasks["transport-4"]
    marks = [
        mark.model_copy(update={"center": (*place, 0.0)})
        for mark, place in zip(task.scenario.marks, places, strict=False)
    ]
    return replace(task, scenario=task.scenario.model_copy(update={"marks": tuple(marks)}))


@slow_on_pybullet
@pytest.mark.parametrize(("wheels", "fires_s"), [("braked", 1.0), ("tapped", 1.0), ("braked", 1.5)])
def test_where_cannons_push_a_car_is_no_stop(engine, tasks, wheels, fires_s) -> None:
    machine = jet_car(wheels, fires_s=fires_s).machine
    _, path = trial(tasks["transport-4"], machine, engine, duration_s=9.0)
    rests = path.positions[-1, 0]
    assert rests[1] > 10.0
    task = _tour_of(tasks, (float(rests[0]), float(rests[1])))
    result, _ = trial(task, machine, engine, duration_s=9.0)
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("not_driven",)


@slow_on_pybullet
def test_a_boom_that_swings_its_tip_stops_nowhere(engine, tasks) -> None:
    draft = boom_on_a_base()
    draft.press("LeftArrow", 0.5, 1.0)
    _, path = trial(tasks["transport-4"], draft.machine, engine, duration_s=5.0)
    rests = path.positions[-1, 0]
    assert float(((rests - path.positions[0, 0]) ** 2).sum()) > 9.0
    task = _tour_of(tasks, (float(rests[0]), float(rests[1])))
    result, _ = trial(task, draft.machine, engine, duration_s=5.0)
    assert (result.success, result.indicator) == (False, 0.0)


@slow_on_pybullet
def test_driving_past_a_point_is_no_stop(engine, tasks) -> None:
    machine = drafted(touring_car(0), [(0.4, "UpArrow", 20.0)])
    task = _tour_of(tasks, (0.0, 20.0), (0.0, 40.0), (0.0, 60.0))
    result, _ = trial(task, machine, engine, duration_s=10.0)
    assert (result.success, result.indicator) == (False, 0.0)


@slow_on_pybullet
def test_stops_in_another_order_do_not_count(engine, tasks) -> None:
    first, second, third = (mark.center[:2] for mark in tasks["transport-4"].scenario.marks)
    task = _tour_of(tasks, second, first, third)
    result, _ = trial(task, drafted(touring_car(0)), engine, duration_s=12.0)
    assert not result.success
    assert result.metrics["stops"] == 1


@slow_on_pybullet
def test_a_car_that_goes_on_in_steps_earns_each_stop(engine, tasks) -> None:
    steps = [(0.4 + 3.0 * k, "UpArrow", 1.2) for k in range(3)]
    machine = drafted(touring_car(0), steps)
    _, path = trial(tasks["transport-4"], machine, engine, duration_s=10.0)
    places = [path.positions[round(25 * (3.2 + 3.0 * k)), 0] for k in range(3)]
    task = _tour_of(tasks, *((float(at[0]), float(at[1])) for at in places))
    result, _ = trial(task, machine, engine, duration_s=10.0)
    assert result.success, result
    assert result.metrics["largest_distance_to_mark"] < 0.2
    assert result.indicator > 3.0
