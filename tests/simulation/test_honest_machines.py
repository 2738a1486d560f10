"""Honest machines count in full, and what is no rocket, bridge or light bridge is refused."""

import json
from collections.abc import Callable
from importlib import resources

import pytest
from support.machines.families import beam, car, rocket_parts
from support.machines.headroom import drafted, propped_beam
from support.machines.references import GOLDENS, REFERENCES, built_designs, outcome, stored
from support.machines.trials import changed, trial
from support.marks import nightly
from tests.benchmark.conftest import shifted

from buildarena_benchmark import TaskError, broken_constraint, load_task, score
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.drafting import DOWN, EAST, SIDES, UP, Draft
from buildarena_benchmark.scoring.registry import known_flags
from buildarena_benchmark.tasks.lift.expert import payload_rocket
from buildarena_benchmark.tasks.mechanisms.expert import loaded_lift
from buildarena_benchmark.tasks.transport.expert import car as fast_car
from buildarena_geometry import Machine

LOAD = 300.0


def test_a_bridge_that_breaks_off_early_still_spans(engine, tasks) -> None:
    result, _ = trial(tasks["support-1"], beam(7, "t"), engine, duration_s=7.0)
    assert (result.success, result.flags) == (True, ())
    assert result.metrics["floor_share"] < 0.01
    assert result.metrics["least_terrain_share"] == pytest.approx(0.5, abs=0.05)


def test_a_long_bridge_counts_and_tells_its_load_over_its_mass(engine, tasks) -> None:
    machine = propped_beam(30)
    result, _ = trial(tasks["support-4"], machine, engine, duration_s=6.0)
    assert (result.success, result.flags) == (True, ())
    ratio = result.indicator / machine.mass
    assert result.metrics["load_per_mass"] == pytest.approx(ratio, abs=1e-5)


def test_an_honest_car_loses_nothing(engine, tasks) -> None:
    drive = [("UpArrow", 1.0, 1.5), ("LeftArrow", 2.5, 0.4), ("UpArrow", 3.0, 1.0)]
    result, _ = trial(tasks["transport-1"], car(5, 1, drive=drive), engine, duration_s=4.0)
    assert (result.success, result.flags) == (True, ())
    assert result.indicator >= 0.98 * float(result.metrics["displacement"])


LIGHT = ("with ballast", "braced beam", "hanging post")


@pytest.mark.parametrize("name", [LIGHT[0], *map(nightly, LIGHT[1:])])
def test_a_light_bridge_is_worth_its_load_over_its_mass(engine, tasks, name) -> None:
    machine = stored(f"light bridge {name}")
    result, _ = trial(tasks["budget-1"], machine, engine)
    assert (result.success, result.flags) == (True, ())
    assert result.indicator == pytest.approx(LOAD / machine.mass, abs=1e-5)


def test_blocks_with_a_gap_below_the_cargo_are_no_deck(tasks) -> None:
    """The same trial, in which the middle block and the post below it stand beside the cargo."""
    task, machine = tasks["budget-1"], drafted(expert_designs()["budget-1"](0), [], modules="all")
    _, path = trial(task, machine, "mujoco")
    middle = [block.id for block in machine.blocks.values() if abs(block.center_xyz[1]) < 0.5]
    result = score(task, machine, shifted(path, [3, 0, 0], *middle))
    assert (result.success, result.indicator, result.flags) == (False, 0.0, ("no_deck",))


def test_a_load_that_is_whole_only_after_the_trial_is_refused() -> None:
    folder = resources.files("buildarena_benchmark.tasks") / "design"
    text = (folder / "budget-1.yaml").read_text(encoding="utf-8")
    with pytest.raises(TaskError, match="the cargo weighs its 300 only when the trial has ended"):
        load_task(text.replace("ramp_s: 8", "ramp_s: 11.5"))


@pytest.mark.nightly(engine="pybullet")
def test_a_car_that_goes_on_in_steps_earns_each_stop(engine, tasks) -> None:
    steps = [(0.4 + 3.0 * k, "UpArrow", 1.2) for k in range(3)]
    machine, task = drafted(fast_car(0), steps), tasks["transport-4"]
    _, path = trial(task, machine, engine, duration_s=10.0)
    marks = [
        mark.model_copy(
            update={"center": (*path.positions[round(25 * (3.2 + 3 * k)), 0, :2].tolist(), 0.0)}
        )
        for k, mark in enumerate(task.scenario.marks)
    ]
    result, _ = trial(changed(task, marks=tuple(marks)), machine, engine, duration_s=10.0)
    assert result.success, result
    assert result.metrics["largest_distance_to_mark"] < 0.2
    assert result.indicator > 3.0


@pytest.mark.parametrize("task", ["lift-4", "mechanisms-7"])
def test_a_load_weighs_what_it_did_when_it_left_the_ground(engine, tasks, task) -> None:
    rocket, lift = drafted(payload_rocket(0), [(0.5, "Alpha1", 12.0)]), loaded_lift(0)
    machine = rocket if task == "lift-4" else drafted(lift, [(0.5, "UpArrow", 1.3)])
    result, _ = trial(tasks[task], machine, engine, duration_s=4.0)
    assert result.success, result
    cargo = tasks[task].scenario.cargo
    assert cargo.mass_at(0.5) <= result.indicator <= cargo.mass_at(1.5)


def _disqualifying(flags: list[str]) -> list[str]:
    return [flag for flag in flags if known_flags()[flag].disqualifying]


HONEST = [name for name, design in built_designs().items() if "verdicts" in design]


@pytest.mark.nightly
@pytest.mark.parametrize("name", HONEST)
def test_machines_of_the_shapes_that_people_build_keep_their_verdict(engine, tasks, name) -> None:
    design, machine = built_designs()[name], stored(name)
    assert broken_constraint(tasks[design["task"]], machine) is None
    now, _ = trial(tasks[design["task"]], machine, engine)
    told = design["verdicts"][engine]
    assert told["success"], "it is built to succeed"
    assert now.success, now
    assert _disqualifying(now.flags) == _disqualifying(told["flags"]) == []


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("name", REFERENCES)
def test_a_reference_machine_gives_what_it_gave(name) -> None:
    expected, found = json.loads(GOLDENS.read_text())[name]["mujoco"], outcome(name, "mujoco")
    assert (found["success"], found["flags"]) == (expected["success"], expected["flags"])
    if expected["success"]:
        assert found["indicator"] == pytest.approx(expected["indicator"], rel=0.05)


def _framed(draw: Callable[[Draft, str], object], *, height: int, sides: int = 4) -> Machine:
    """The engine of a rocket under a frame, on so many braces.

    Args:
        draw: Builds the frame on its starting block.
        height: Of the frame's starting block above the engine's.
        sides: On how many sides a brace joins the two.
    """
    frame = Draft()
    draw(frame, frame.start())
    whole = Draft({"engine": rocket_parts()["engine"], "frame": frame.machine})
    whole.do("add_machine", machine_id="frame", init_shift=[0, 0, height])
    whole.do("add_machine", machine_id="engine", init_shift=[0, 0, 0])
    for side in SIDES[:sides]:
        whole.connect("A_1", "B_1", side, UP)
    return whole.machine


def _cross(frame: Draft, middle: str) -> None:
    for side in SIDES:
        frame.row(middle, side, 2)


def _with_cannons(frame: Draft, middle: str) -> None:
    _cross(frame, middle)
    frame.cannon(frame.row(middle, UP, 2)[-1], EAST, DOWN)


def _with_a_foot(frame: Draft, middle: str) -> None:
    _cross(frame, middle)
    frame.row(middle, DOWN, 2)


def _column(height: int) -> Callable[[Draft, str], object]:
    return lambda frame, middle: frame.row(middle, UP, height)


def test_a_token_frame_is_refused(tasks) -> None:
    """One of eight blocks or more that braces hold from all sides is taken."""
    refused = [
        (_column(1), 2, 4, "the frame A has 2 blocks"),
        (_column(6), 2, 4, "the frame A has 7 blocks"),
        (_column(7), 2, 1, "the frame has 2"),
        (_with_a_foot, 3, 4, "blocks A_11 and B_1 hold on to each other"),
        (_with_cannons, 2, 4, "every sub-structure has cannons"),
    ]
    for draw, height, sides, problem in refused:
        machine = _framed(draw, height=height, sides=sides)
        reason, told = broken_constraint(tasks["lift-3"], machine) or ("", "")
        assert (reason, told.startswith(problem)) == ("constraint_violated", True), told
    for draw, height in ((_cross, 2), (_with_a_foot, 4), (_column(7), 2)):
        assert broken_constraint(tasks["lift-3"], _framed(draw, height=height)) is None
