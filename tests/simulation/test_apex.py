"""How near to a stated height a cargo's highest point is: what counts, and what does not."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark import TaskError, builtin_tasks, parse_task
from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Direction

TASK = builtin_tasks()["identify-1"]
FAN, GRABBER = "Flying Block", "Grabber"
SIDES: tuple[Direction, ...] = (EAST, WEST, NORTH, SOUTH)


def with_rise(rise: float, **scenario: object):
    """The task in its file's world, with another rise."""
    scoring = TASK.scoring.model_copy(update={"rise": rise})
    return replace(TASK, scoring=scoring, scenario=TASK.scenario.model_copy(update=scenario))


def flyer(hold_s: float, *, arms: int = 3, weak: bool = False) -> Machine:
    """A cross of fans with a grabber; `weak` hangs something on that comes off."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    gripper = draft.attach(middle, DOWN, GRABBER)
    draft.bind(gripper, "grab", "Alpha9")
    for side in SIDES:
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
    first, _ = trial(with_rise(60), machine, engine)
    rise = first.metrics["rise"]
    assert rise > 10
    for off, success in ((0.0, True), (1.5, True), (3.0, False), (-3.0, False), (11.0, False)):
        result, _ = trial(with_rise(rise + off), machine, engine, duration_s=10)
        assert result.success is success
        assert result.indicator == pytest.approx(max(0.0, 1 - abs(off) / 10), abs=0.01)
        assert result.flags == ()


@pytest.mark.nightly(engine="pybullet")
def test_parts_that_come_off_on_the_way_up_are_told_of(engine) -> None:
    machine = flyer(1.5, weak=True)
    first, _ = trial(with_rise(60), machine, engine)
    result, _ = trial(with_rise(first.metrics["rise"]), machine, engine)
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
    first, _ = trial(with_rise(60), machine, engine, drive_strength=3.0)
    rise = first.metrics["rise"]
    result, _ = trial(with_rise(max(rise, 0.5)), machine, engine, drive_strength=3.0)
    if result.flags == ("not_airborne",):
        assert (result.success, result.indicator) == (False, 0.0)
    else:  # it took off: then nothing of it is a lever
        assert result.metrics["top_s"] > 0.5


def test_who_stays_on_the_ground_has_nothing(engine) -> None:
    result, _ = trial(with_rise(60), flyer(0.3, arms=2), engine)
    assert (result.success, result.indicator) == (False, 0.0)


def test_files_that_nobody_could_play_are_refused() -> None:
    folder = resources.files("buildarena_benchmark.tasks") / "catalogue"
    text = (folder / "identify-1.yaml").read_text()
    for was, becomes, says in (
        ("cargo: {size: [2, 2, 1], at: [0, 0, 0],", "cargo: {size: [2, 2, 1],", "cargo.at"),
        ("max_off: 2", "max_off: 12", "no less than reach"),
        ("gravity: [24, 40]", "gravity: [40, 24]", "no range"),
        ("gravity: [24, 40]", "gravity: [2, 40]", "gravity"),
        ("gravity: [24, 40]", "gravity: [24, 400]", "gravity"),
        ("drive_strength: [0.8, 1.25]", "drive_strength: [0.8, 125]", "drive_strength"),
        ("tests: 5", "tests: 0", "tests"),
        ("tests: 5", "tests: 21", "tests"),
        ("tests: 5", "tests: 5\n  friction: [0.1, 1]", "friction"),
        ("control: {mode: agent}", "control: {mode: none}", "control"),
    ):
        assert was in text
        with pytest.raises(TaskError, match=says):
            parse_task(text.replace(was, becomes), origin="identify-1.yaml")
