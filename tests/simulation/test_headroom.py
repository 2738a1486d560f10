"""The tasks with headroom: what must not count, and honest machines beside the expert's that do."""

from dataclasses import replace

import pytest
from support.machines.headroom import boom_on_a_base, drafted, propped_beam
from support.machines.jet_cars import jet_car
from support.machines.masts import balloons_on_a_mast
from support.machines.people.bridges import beam
from support.machines.see_saws import see_saw
from support.machines.swinging_bars import swinging_bar
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark import Task
from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.arms import loaded_lift, swinging_arm
from buildarena_worker.builtin.designs.flyers import stepping_hoverer
from buildarena_worker.builtin.designs.rockets import payload_rocket
from buildarena_worker.builtin.designs.rovers import long_slalom_car, touring_car

# Support over 30 and 45

SPANS = [("support-4", 30), nightly("support-5", 45)]


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(("task", "gap"), SPANS)
@pytest.mark.parametrize("below", [{"places": (0,), "foot": 2}, {"places": (-6, 6)}])
def test_what_the_gaps_floor_bears_is_no_long_bridge(engine, tasks, task, gap, below) -> None:
    result, _ = trial(tasks[task], propped_beam(gap, **below), engine, duration_s=6.0)
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.metrics["load_per_mass"] == 0.0


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(("overlap", "depth"), [(8, 1), (6, 2)])
def test_debris_that_lies_on_the_floor_takes_nothing_back(engine, tasks, overlap, depth) -> None:
    machine = beam(30, overlap=overlap, depth=depth)
    result, path = trial(tasks["support-4"], machine, engine, duration_s=10.0)
    assert path.bearing.ground.max() > 100.0, "it does come down"
    assert result.success, result
    assert result.flags == ()


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(("task", "gap"), SPANS)
@pytest.mark.parametrize("height", [3, 4])
def test_stilts_that_hang_over_the_floor_add_nothing(engine, tasks, task, gap, height) -> None:
    bare, stilted = (
        trial(tasks[task], propped_beam(gap, places, height=height, foot=1), engine, duration_s=8.0)
        for places in ((), (-3, 3))
    )
    # They weigh a fifth of the machine, so the cargo bounces a little less.
    assert stilted[0].indicator <= 1.1 * bare[0].indicator


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
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
    assert asking == {f"support-{level}" for level in (4, 5, 6, 7)}


# A slalom of twelve gates


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_car_that_drives_straight_on_passes_no_more_than_one_side(engine, tasks) -> None:
    for turn_s in (0.0, 0.02):
        steered = [(0.8, "RightArrow", turn_s), (1.2, "LeftArrow", turn_s)] if turn_s else []
        machine = drafted(long_slalom_car(0), [(0.3, "UpArrow", 29.0), *steered])
        result, _ = trial(tasks["mechanisms-5"], machine, engine, duration_s=22.0)
        assert not result.success
        assert result.metrics["gates"] <= 6


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("tip", ["bare", "heavy", "wheeled"])
def test_a_bar_that_swings_its_starting_block_passes_no_gate_by_it(engine, tasks, tip) -> None:
    machine = swinging_bar(tip, drive_s=1.6).machine
    result, _ = trial(tasks["mechanisms-5"], machine, engine, duration_s=12.0)
    assert not result.success
    assert result.metrics["gates"] <= 1, "the first gate's end is straight ahead"


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("wheels", ["braked", "backward", "tapped"])
def test_a_car_that_cannons_push_passes_no_gate(engine, tasks, wheels) -> None:
    result, _ = trial(tasks["mechanisms-5"], jet_car(wheels).machine, engine, duration_s=5.0)
    assert (result.success, result.indicator) == (False, 0.0)


# Placed to 0.3

ARM = [(1.0, "LeftArrow", 3.96), (9.0, "Alpha1", 0.2), (10.0, "RightArrow", 0.5)]


def _arm(*presses: tuple[float, str, float]) -> Machine:
    return drafted(swinging_arm(0), presses)


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
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


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
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


@pytest.mark.nightly(engine="pybullet")
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


@pytest.mark.nightly(engine="pybullet")
def test_a_boom_that_swings_its_tip_stops_nowhere(engine, tasks) -> None:
    draft = boom_on_a_base()
    draft.press("LeftArrow", 0.5, 1.0)
    _, path = trial(tasks["transport-4"], draft.machine, engine, duration_s=5.0)
    rests = path.positions[-1, 0]
    assert float(((rests - path.positions[0, 0]) ** 2).sum()) > 9.0
    task = _tour_of(tasks, (float(rests[0]), float(rests[1])))
    result, _ = trial(task, draft.machine, engine, duration_s=5.0)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(engine="pybullet")
def test_driving_past_a_point_is_no_stop(engine, tasks) -> None:
    machine = drafted(touring_car(0), [(0.4, "UpArrow", 20.0)])
    task = _tour_of(tasks, (0.0, 20.0), (0.0, 40.0), (0.0, 60.0))
    result, _ = trial(task, machine, engine, duration_s=10.0)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(engine="pybullet")
def test_stops_in_another_order_do_not_count(engine, tasks) -> None:
    first, second, third = (mark.center[:2] for mark in tasks["transport-4"].scenario.marks)
    task = _tour_of(tasks, second, first, third)
    result, _ = trial(task, drafted(touring_car(0)), engine, duration_s=12.0)
    assert not result.success
    assert result.metrics["stops"] == 1


@pytest.mark.nightly(engine="pybullet")
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


# Three heights


def _stepping(*presses: tuple[float, str, float]) -> Machine:
    return drafted(stepping_hoverer(0), presses)


@pytest.mark.nightly(keep=2)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("mast", ["below", "aside", "hanging", "legs"])
def test_a_mast_that_is_lifted_a_little_holds_no_height(engine, tasks, mast) -> None:
    machine = balloons_on_a_mast(mast, rise_s=1.0).machine
    result, _ = trial(tasks["flight-3"], machine, engine, duration_s=8.0)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(
    ("presses", "held_s"),
    [
        ([(0.3, "UpArrow", 7.35)], 0.5),  # past the first height to the second, and there it stays
        ([(0.3, "UpArrow", 7.35), (13.0, "DownArrow", 3.0)], 0.5),
        ([(0.3, "UpArrow", 4.35)], 10.0),
    ],
    ids=["the second alone", "the second, then the first", "the first alone"],
)
def test_heights_are_held_in_their_order(engine, tasks, presses, held_s) -> None:
    result, _ = trial(tasks["flight-3"], _stepping(*presses), engine, duration_s=17.0)
    assert not result.success
    assert result.metrics["heights_held"] == 1
    assert result.indicator <= 10.0 + held_s


@pytest.mark.nightly(engine="pybullet")
def test_a_hoverer_without_its_cargo_holds_nothing(engine, tasks) -> None:
    task = tasks["flight-3"]
    cargo = task.scenario.cargo.model_copy(update={"at": (6, 6, 0)})
    machine = _stepping((0.3, "UpArrow", 3.8), (9.0, "UpArrow", 3.0), (16.0, "DownArrow", 1.5))
    result, path = trial(task, machine, engine, cargo=cargo, duration_s=21.0)
    assert path.positions[:, 0, 2].max() > 13.0
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_a_hoverer_may_hurry_from_height_to_height(engine, tasks) -> None:
    machine = _stepping((0.3, "UpArrow", 4.35), (9.0, "UpArrow", 3.0), (16.5, "DownArrow", 1.5))
    result, _ = trial(tasks["flight-3"], machine, engine, duration_s=23.0)
    assert result.success, result
    assert result.flags == ()
    assert result.indicator > 9.0


# A payload


def _payload(*presses: tuple[float, str, float]) -> Machine:
    """The expert's rocket, whose gripper lets go at a key."""
    design = payload_rocket(0)
    gripper = design.control["control_config"][0]
    released = {**gripper, "action": "release", "keys": ["Alpha3"]}
    config = [*design.control["control_config"], released]
    return drafted(replace(design, control={"control_config": config}), presses)


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("release_s", [0.0, 2.2])
def test_a_payload_that_is_let_go_does_not_count(engine, tasks, release_s) -> None:
    machine = _payload((release_s, "Alpha3", 1.0), (1.9, "Alpha1", 12.0))
    result, path = trial(tasks["lift-4"], machine, engine, duration_s=6.0)
    assert path.positions[:, 0, 2].max() > 30.0
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("fires_s", [0.9, 1.0])
@pytest.mark.parametrize("thrown", [False, True])
def test_a_payload_that_coasts_or_is_thrown_does_not_count(engine, tasks, fires_s, thrown) -> None:
    let_go = [(0.24 + fires_s, "Alpha3", 0.5)] if thrown else []
    machine = _payload((0.2, "Alpha1", fires_s), *let_go)
    result, path = trial(tasks["lift-4"], machine, engine, duration_s=5.0)
    assert path.cargo_position[:, 2].max() > 31.0
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("not_carried",)


@pytest.mark.nightly(engine="pybullet")
def test_what_is_too_heavy_stays_down_however_long_it_fires(engine, tasks) -> None:
    for begin_s in (4.5, 8.0):
        machine = drafted(payload_rocket(0), [(begin_s, "Alpha1", 5.0)])
        result, _ = trial(tasks["lift-4"], machine, engine, duration_s=begin_s + 6.0)
        assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("begin_s", [0.5, 1.5])
def test_a_payload_weighs_what_it_did_when_it_left_the_ground(engine, tasks, begin_s) -> None:
    machine = drafted(payload_rocket(0), [(begin_s, "Alpha1", 12.0)])
    result, _ = trial(tasks["lift-4"], machine, engine, duration_s=begin_s + 4.0)
    assert result.success, result
    cargo = tasks["lift-4"].scenario.cargo
    assert cargo.mass_at(begin_s) <= result.indicator <= cargo.mass_at(begin_s + 0.6)


# A load hauled


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(
    ("pivot", "show"), [("Swivel", "apart"), ("Swivel", "meshing"), ("Swivel", "on the beam")]
)
def test_a_see_saw_hauls_no_load(engine, tasks, pivot, show) -> None:
    machine = see_saw(pivot, show=show).machine
    result, path = trial(tasks["mechanisms-7"], machine, engine, duration_s=6.0)
    assert path.cargo_position[:, 2].max() > 5.0, "it does lift the cargo"
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(keep=1)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(("begin_s", "lasts_s"), [(0.7, 0.3), (8.0, 3.0), (3.0, 1.6)])
def test_a_lift_that_ends_low_hauls_nothing(engine, tasks, begin_s, lasts_s) -> None:
    machine = drafted(loaded_lift(0), [(begin_s, "UpArrow", lasts_s)])
    result, path = trial(tasks["mechanisms-7"], machine, engine, duration_s=begin_s + 4.0)
    assert path.cargo_position[:, 2].max() < 5.5
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("begin_s", [0.8, 0.9])
def test_a_load_weighs_what_it_did_when_it_left_the_ground(engine, tasks, begin_s) -> None:
    machine = drafted(loaded_lift(0), [(begin_s, "UpArrow", 1.3)])
    result, _ = trial(tasks["mechanisms-7"], machine, engine, duration_s=begin_s + 3.0)
    assert result.success, result
    cargo = tasks["mechanisms-7"].scenario.cargo
    assert cargo.mass_at(begin_s) <= result.indicator <= cargo.mass_at(begin_s + 1.0)
