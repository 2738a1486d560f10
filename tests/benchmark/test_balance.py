"""Standing on two wheels: what must not count, whatever it looks like."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.piloted import experts_machine, scored

from buildarena_benchmark import TaskError, builtin_tasks, load_task, score
from buildarena_simulation import ENGINES, simulate
from buildarena_worker.builtin.designs.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Direction,
    Draft,
)

IDLE: Final = "function control() return {} end"
TASKS: Final = {name: builtin_tasks()[name] for name in ("balance-1", "balance-2")}
SHARED: Final = "function control(t) return { spinning_forward = %s } end"


def cart(
    *, logs: int = 3, wheel: str = "Powered Wheel", arm: int = 1, ways: tuple[Direction, ...] = ()
) -> KeyedDraft:
    """A mast on an axle; block 1 is in the axle's middle, the last one is the mast's top."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way in ways or (EAST, WEST):
        draft.wheel(draft.row(middle, way, arm)[-1], way, wheel)
    top = middle
    for _ in range(logs):
        top = draft.attach(top, UP, "Log")
    return draft


def top_of(draft: Draft) -> str:
    return list(draft.machine.blocks)[-1]


def short() -> KeyedDraft:
    """Hangs under its axle: large wheels, and what is heavy low between them."""
    draft = cart(logs=0, wheel="Large Wheel", arm=1)
    draft.attach("1", DOWN, "Ballast")
    return draft


def low() -> KeyedDraft:
    """A mast, but wide bars at the axle's height: the centre of mass is above it by less."""
    draft = cart(logs=2)
    for way in (NORTH, SOUTH):
        draft.attach("1", way, "Log")
    return draft


def third_wheel() -> KeyedDraft:
    draft = cart()
    far = draft.row("1", NORTH, 3)[-1]
    draft.wheel(far, EAST)
    return draft


def tandem() -> KeyedDraft:
    """One wheel in front of the other: they stand by themselves, as a bicycle does not."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way, side in ((NORTH, EAST), (SOUTH, WEST)):
        draft.wheel(draft.row(middle, way, 2)[-1], side, "Large Wheel")
    draft.attach(draft.attach(middle, UP, "Log"), UP, "Log")
    return draft


def flat() -> KeyedDraft:
    """On a wheel that lies, as on a foot, with the second wheel on the same axis above."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    draft.attach(middle, DOWN, "Large Wheel")
    top = draft.attach(draft.attach(middle, UP, "Log"), UP, "Log")
    draft.attach(top, UP, "Powered Wheel")
    return draft


def north_south() -> KeyedDraft:
    """Its axle lies along the tilt, which its wheels bear; forwards it stands exactly upright."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way in (NORTH, SOUTH):
        draft.attach(draft.row(middle, way, 2)[-1], way, "Powered Wheel")
    top = middle
    for _ in range(3):
        top = draft.attach(top, UP, "Log")
    return draft


def on_skids() -> KeyedDraft:
    """Legs before and behind the wheels end just above the ground, and bear once it leans."""
    draft = cart(wheel="Large Wheel")
    for way in (NORTH, SOUTH):
        draft.row(draft.row("1", way, 4)[-1], DOWN, 1)
    return draft


def on_feet() -> KeyedDraft:
    """Feet on the wheels' outer faces: wide, flat, and as low as the wheels."""
    draft = cart(wheel="Large Wheel", arm=1)
    for wheel, way in (("3", EAST), ("5", WEST)):
        hub = draft.attach(wheel, way)
        draft.attach(hub, DOWN)
        for side in (NORTH, SOUTH):
            draft.row(hub, side, 3)
    return draft


def with_pole() -> KeyedDraft:
    """Leans on poles that reach the ground far before and behind it."""
    draft = cart()
    top = top_of(draft)
    for way in (NORTH, SOUTH):
        end = draft.attach(top, way)
        for _ in range(2):
            end = draft.attach(end, way, "Log")
        for _ in range(3):
            end = draft.attach(end, DOWN, "Log")
    return draft


MACHINES: Final[Mapping[str, Callable[[], KeyedDraft]]] = {
    "short": short,
    "low": low,
    "third wheel": third_wheel,
    "tandem": tandem,
    "flat": flat,
    "north-south": north_south,
    "on skids": on_skids,
    "on feet": on_feet,
    "with pole": with_pole,
    "mast": cart,
    "high mast": lambda: cart(logs=12),
    "large wheels": lambda: cart(wheel="Large Wheel"),
}
STANDS: Final = {"short", "third wheel", "tandem", "flat"}
"""Those that stand for good by themselves; the rules alone refuse them."""


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", MACHINES)
def test_who_does_nothing_does_not_balance(name, engine) -> None:
    task = TASKS["balance-1"]
    machine = MACHINES[name]().machine.with_controller(IDLE)
    trial = simulate(machine, task.scenario, engine)
    result = score(task, machine, trial)
    assert not result.success, result
    assert result.indicator < 15
    upright = trial.quaternions[-1, 0].astype(float)
    stands = 1 - 2 * (upright[1] ** 2 + upright[2] ** 2) > 0.98
    assert stands or name not in STANDS


@pytest.mark.nightly
def test_wheels_that_are_not_two_on_one_level_axle_east_and_west_are_named() -> None:
    for name in ("third wheel", "tandem", "flat", "north-south"):
        machine = MACHINES[name]().machine.with_controller(IDLE)
        result = scored(TASKS["balance-1"], machine, "mujoco", None)
        assert (result.indicator, result.flags) == (0, ("not_on_two_wheels",)), name


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
def test_what_stands_because_its_mass_is_low_is_flagged(engine) -> None:
    result = scored(TASKS["balance-1"], short().machine.with_controller(IDLE), engine, None)
    assert (result.success, result.indicator, result.flags) == (False, 0, ("propped",))


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("share", ["1", "0.3", "t % 0.4 < 0.2 and 1 or -1"])
def test_driving_on_and_shaking_do_not_balance(engine, share) -> None:
    machine = cart().machine.with_controller(SHARED % share)
    assert not scored(TASKS["balance-1"], machine, engine, 1).success


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_spinning_in_place_does_not_balance(engine, seed) -> None:
    """A long bar above the wheels, which turns about the vertical: that may keep it level."""
    draft = cart(logs=1, wheel="Large Wheel")
    top = top_of(draft)
    for way in (NORTH, SOUTH):
        draft.attach(draft.attach(draft.attach(top, way, "Log"), way, "Log"), way, "Log")
    program = """
    function control(t)
      local share = math.min(1, t / 2)
      return { ["3.spinning_forward"] = share, ["5.spinning_forward"] = -share }
    end"""
    result = scored(TASKS["balance-1"], draft.machine.with_controller(program), engine, seed)
    assert not result.success
    assert result.indicator < 5


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
def test_a_wheel_that_comes_off_ends_it(engine) -> None:
    """The same trial, in which a wheel goes on by itself half way."""
    task = TASKS["balance-1"]
    machine = experts_machine(task)
    trial = simulate(machine, task.scenario, engine)
    assert score(task, machine, trial).success
    pieces = trial.pieces.copy()
    pieces[300:, 2] = pieces.max() + 1
    result = score(task, machine, replace(trial, pieces=pieces))
    assert (result.success, result.flags) == (False, ("came_apart",))
    assert result.metrics["balanced_s"] == pytest.approx(300 / 25 - 0.04)


def test_each_threshold_ends_a_balance(subtests) -> None:
    for stricter in [{"max_tilt_deg": 0.5}, {"min_height": 2.5}, {"min_clearance": 0.6}]:
        with subtests.test(stricter=stricter):
            task = TASKS["balance-2"]
            machine = experts_machine(task)
            trial = simulate(machine, task.scenario, "mujoco")
            assert score(task, machine, trial).success
            result = score(load_task(_changed(task, scoring=stricter)), machine, trial)
            assert not result.success
            assert result.flags == (() if "max_tilt_deg" in stricter else ("propped",))


@pytest.mark.nightly
def test_who_keeps_its_place_earns_more_and_who_falls_only_its_time() -> None:
    task = TASKS["balance-2"]
    machine = experts_machine(task)
    still = scored(task, machine, "mujoco", None)
    roams = machine.with_controller(machine.controller.replace("clip(place, 3)", "0.3"))
    away = scored(task, roams, "mujoco", None)
    assert away.success
    assert 25 < away.indicator < still.indicator < 26
    fallen = scored(task, machine.with_controller(IDLE), "mujoco", None)
    assert fallen.indicator == fallen.metrics["balanced_s"] < 3


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
def test_pushes_are_what_makes_the_second_harder(engine) -> None:
    """A program that stands, and takes no notice of its place, falls or drifts when pushed."""
    task = TASKS["balance-2"]
    machine = experts_machine(task)
    calm, pushed = (
        scored(which, machine, engine, 3).metrics["farthest_from_start"]
        for which in (TASKS["balance-1"], task)
    )
    assert pushed > calm + 0.3


def test_a_balance_that_nobody_can_keep_is_refused(subtests) -> None:
    for changes, told in [
        ({"placement": {"kind": "released", "height": 5}, "draws": {}}, "not alone on flat"),
        ({"terrain": [{"center": [0, 9, 1], "size": [2, 2, 2]}]}, "not alone on flat"),
        ({"cargo": {"size": [1, 1, 1], "final_mass": 5, "ramp_s": 1}}, "not alone on flat"),
        ({"duration_s": 15}, "min_s 20 is longer"),
        ({"control": {"mode": "none"}}, "control"),
    ]:
        with subtests.test(changes=changes), pytest.raises(TaskError, match=told):
            load_task(_changed(TASKS["balance-1"], scenario=changes))


def _changed(task: Any, **parts: Mapping[str, Any]) -> str:
    document = dict(task.as_document()) | {"name": "stricter"}
    for part, changes in parts.items():
        document[part] = {**document[part], **changes}
    return json.dumps({key: value for key, value in document.items() if value is not None}) + "\n"
