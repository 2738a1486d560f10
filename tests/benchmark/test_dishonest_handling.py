"""Things thrown, delivered, fetched and placed in ways that must not count; and courses."""

from __future__ import annotations

from typing import Any, Final

import pytest
from support.machines.building import KeyedDraft
from support.machines.piloted import scored
from tests.benchmark.conftest import expert, strict

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts.drafting import EAST, NORTH, SOUTH, UP, WEST
from buildarena_simulation import MachineNotSimulable, simulate

TASKS: Final = builtin_tasks()
THROW: Final = TASKS["throw-1"]


def fails(result: Any, *flags: str) -> None:
    assert (result.success, result.indicator) == (False, 0.0), result
    assert set(flags) <= set(result.flags), result


# Throwing


@pytest.mark.nightly
def test_a_boulder_that_begins_inside_its_cup(engine) -> None:
    """Engines part what overlaps: whoever throws so is refused."""
    thrown = expert("throw-1")
    boulder = next(b.id for b in thrown.blocks.values() if b.module.name == "Boulder")
    assert thrown.act("shift_block", {"block_id": boulder, "shift_real": [0, 0, -0.45]}).ok
    fails(scored(THROW, thrown, engine, None), "unexplained")


@pytest.mark.nightly(keep=1)
def test_who_throws_at_once_or_lets_it_lie_or_drops_it_throws_nothing(engine) -> None:
    """A boulder is borne for a second first."""
    fails(scored(THROW, expert("throw-1", [(0.2, "Alpha1", 4.0)]), engine, None), "not_borne")
    draft = KeyedDraft(modules="all")
    draft.attach(draft.row(draft.start(), UP, 2)[-1], NORTH, "Boulder")
    for machine in (draft.machine, expert("throw-1", [])):
        fails(scored(strict(THROW, min_distance=0.0), machine, engine, None))


def test_a_machine_in_a_things_place_is_refused() -> None:
    """In the ball's, the cargo's in the exact and another world, and in the well's."""
    world = round(TASKS["place-2"].scenario.world(0).cargo.at[1])
    for name, rows, seed, told in (
        ("deliver-2", [(UP, 1), (NORTH, 7)], None, "overlaps the cargo"),
        ("place-2", [(NORTH, 2), (WEST, 6)], None, "overlaps the cargo"),
        ("place-2", [(NORTH if world > 0 else SOUTH, abs(world)), (WEST, 6)], 0, "the cargo"),
        ("fetch-1", [(NORTH, 4), (WEST, 8)], None, "overlaps terrain"),
    ):
        draft = KeyedDraft(modules="workshop")
        end = draft.start()
        for way, count in rows:
            end = draft.row(end, way, count)[-1] if count else end
        machine = draft.machine
        if TASKS[name].takes_programs:
            machine = machine.with_controller("function control() return {} end")
        with pytest.raises(MachineNotSimulable, match=told):
            simulate(machine, TASKS[name].scenario, "mujoco", seed=seed)


# Delivering a ball


@pytest.mark.nightly(keep=1)
def test_a_ball_that_is_kicked(engine) -> None:
    """The same car brakes half way, and the ball rolls on over the line."""
    result = scored(TASKS["deliver-2"], expert("deliver-2", [(0.4, "UpArrow", 2.4)]), engine, None)
    assert (result.success, result.flags) == (False, ("let_go",))
    assert 0.2 < result.indicator < 0.9


# Courses


@pytest.mark.nightly
def test_a_tower_that_topples_over_the_gates_drives_nothing() -> None:
    """Its mass gets over the first two lines of drive-2, and its wheels turn in the air."""
    draft = KeyedDraft(modules="workshop")
    base = draft.start()
    for side in (EAST, WEST):
        draft.bind(draft.wheel(base, side), "spinning_forward", "UpArrow")
    draft.attach(draft.row(base, UP, 30)[-1], NORTH, "Log")
    draft.press("UpArrow", 0.5, 0.3)
    fails(scored(TASKS["drive-4"], draft.machine, "mujoco", None))


# Fetching and placing


@pytest.mark.nightly
def test_a_weight_that_is_let_lie_or_dropped_is_not_fetched() -> None:
    """Let go at the top of its way it falls for itself by more than 3."""
    takes = (0.6, "RightArrow", 0.38)
    for presses in ([], [takes], [takes, (2.6, "LeftArrow", 3.0), (9.0, "Alpha1", 0.2)]):
        result = scored(TASKS["fetch-1"], expert("fetch-1", presses), "mujoco", None)
        assert not result.success
        if len(presses) > 1:
            assert result.metrics["loose_way"] > 3
        else:
            assert result.metrics["distance_to_mark"] > 15


LIFTS: Final = "function(sense, answer, t) return raise(answer, t) end"
SWINGS: Final = "function(sense, answer) return reach(sense, answer, seen.goal) end"
RELEASES: Final = 'answer[GRIPPER .. ".release"] = t > 2.5 and 1 or 0'
LETS_GO: Final = 'answer.extend, answer[GRIPPER .. ".release"] = HOLDS, 1 return t > 0.5'
THROWS: Final = SWINGS.replace("return", f"{RELEASES} return", 1).replace(
    "answer)", "answer, t)", 1
)
VARIANTS: Final = {
    "pushes it along the ground": [
        (LIFTS, "function(sense, answer, t) answer.extend = HOLDS return t > 1 end"),
        (SWINGS, SWINGS.replace("return", "answer.extend = HOLDS return", 1)),
    ],
    "throws it": [(SWINGS, THROWS)],
    "never lets go": [(LETS_GO, "answer.extend = HOLDS return false")],
    "takes hold of nothing": [("clip((most - length) / 3, 0.2)", "0")],
}


@pytest.mark.nightly
@pytest.mark.parametrize("how", VARIANTS)
def test_what_is_not_put_down_from_the_arm(engine, how) -> None:
    machine = expert("place-2")
    program = machine.controller
    for before, after in VARIANTS[how]:
        assert program.count(before) == 1, before
        program = program.replace(before, after)
    fails(scored(TASKS["place-2"], machine.with_controller(program), engine, None))
