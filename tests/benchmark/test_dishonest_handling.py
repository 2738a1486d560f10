"""Things thrown, delivered, fetched and placed in ways that must not count; and courses."""

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
def test_who_lets_it_lie_or_drops_it_throws_nothing(engine) -> None:
    draft = KeyedDraft(modules="all")
    draft.attach(draft.row(draft.start(), UP, 2)[-1], NORTH, "Boulder")
    for machine in (draft.machine, expert("throw-1", [])):
        fails(scored(strict(THROW, min_distance=0.0), machine, engine, None))


def test_a_machine_in_a_things_place_is_refused() -> None:
    """In the ball's, the cargo's in the exact and another world, and in the well's."""
    world = round(TASKS["place-2"].scenario.world(0).cargo.at[1])
    for name, rows, seed, message in (
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
        with pytest.raises(MachineNotSimulable, match=message):
            simulate(machine, TASKS[name].scenario, "mujoco", seed=seed)


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
