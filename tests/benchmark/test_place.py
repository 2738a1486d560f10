"""A cargo that is put down wherever its mark is: what must not count, whatever it looks like."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from typing import Any, Final

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.piloted import FASTER_FIRST, experts_machine, scored

from buildarena_benchmark import TaskError, builtin_tasks, load_task, score
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, Trajectory, simulate
from buildarena_worker.builtin.designs import piloted
from buildarena_worker.builtin.designs.drafting import NORTH, SOUTH, WEST

TASK: Final = builtin_tasks()["place-2"]
LETS_GO: Final = 'answer.extend, answer[GRIPPER .. ".release"] = HOLDS, 1 return t > 0.5'
LIFTS: Final = "function(sense, answer, t) return raise(answer, t) end"
SWINGS: Final = "function(sense, answer) return reach(sense, answer, seen.goal) end"


@cache
def honest(engine: str) -> tuple[Machine, Trajectory]:
    """The expert's machine, and its trial in the exact world."""
    machine = experts_machine(TASK)
    return machine, simulate(machine, TASK.scenario, engine)


@cache
def varied(how: str, engine: str) -> tuple[Machine, Trajectory]:
    """A variant of it, and its trial."""
    machine = changed(*VARIANTS[how])
    return machine, simulate(machine, TASK.scenario, engine)


def changed(*changes: tuple[str, str]) -> Machine:
    """The expert's machine, whose program does something else."""
    machine = experts_machine(TASK)
    program = machine.controller
    for before, after in changes:
        assert program.count(before) == 1, before
        program = program.replace(before, after)
    return machine.with_controller(program)


LETTING_GO: Final = (
    'function(sense, answer, t) answer[GRIPPER .. ".release"] = t > 2.5 and 1 or 0'
    " return reach(sense, answer, seen.goal) end"
)
VARIANTS: Final = {
    "pushes it along the ground": [
        (LIFTS, "function(sense, answer, t) answer.extend = HOLDS return t > 1 end"),
        (SWINGS, SWINGS.replace("return", "answer.extend = HOLDS return", 1)),
    ],
    "throws it": [(SWINGS, LETTING_GO)],
    "never lets go": [(LETS_GO, "answer.extend = HOLDS return false")],
    "takes hold of nothing": [("clip((most - length) / 3, 0.2)", "0")],
}


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("how", VARIANTS)
def test_what_is_not_put_down_from_the_arm(engine, how) -> None:
    result = score(TASK, *varied(how, engine))
    assert (result.success, result.indicator) == (False, 0.0), result


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_cargo_that_is_held_over_the_mark_is_not_put_down(engine) -> None:
    """It is exactly where it shall be, and nothing of that counts until it is let go."""
    result = score(TASK, *varied("never lets go", engine))
    assert result.metrics["carried"]
    assert result.metrics["distance_to_mark"] < 0.5
    assert result.indicator == 0
    lax = replace(TASK, scoring=TASK.scoring.model_copy(update={"must_rest": False}))
    assert score(lax, *varied("never lets go", engine)).indicator > 2


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_cargo_that_falls_from_the_arm_was_loose(engine) -> None:
    """It may fall by what is allowed, and no farther."""
    machine = changed(("DOWN - 0.08", "0.1"))
    falls = simulate(machine, TASK.scenario, engine)
    assert score(TASK, machine, falls).metrics["loose_way"] > 1
    strict = replace(TASK, scoring=TASK.scoring.model_copy(update={"max_loose": 0.8}))
    assert score(strict, *honest(engine)).success
    assert not score(strict, machine, falls).success


@pytest.mark.nightly
def test_who_remembers_where_things_were_fails_where_they_are_not(subtests) -> None:
    """It looks at one of the two only; for the other it takes the exact world's place."""
    for what in ["cargo", "goal"]:
        with subtests.test(what=what):
            place = {"cargo": TASK.scenario.cargo.at, "goal": TASK.scenario.marks[0].center}[what]
            known = f"reach(sense, answer, {{ x = {place[0]}, y = {place[1]} }})"
            program = experts_machine(TASK).controller.replace(
                f"reach(sense, answer, seen.{what})", known
            )
            machine = experts_machine(TASK).with_controller(program)
            assert scored(TASK, machine, "mujoco", None).success
            seeds = [seed for seed in range(20) if _apart(seed, what) > 2.5][:2]
            assert not any(scored(TASK, machine, "mujoco", seed).success for seed in seeds)


def _apart(seed: int, what: str) -> float:
    """How far from where it is in the exact world something is in another."""
    world, exact = TASK.scenario.world(seed), TASK.scenario
    if what == "cargo":
        return math.dist(world.cargo.at, exact.cargo.at)
    return math.dist(world.marks[0].center, exact.marks[0].center)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_what_topples_over_has_placed_nothing(engine, monkeypatch) -> None:
    """The same arm on a small foot."""
    monkeypatch.setattr(piloted, "_FOOT", 2)
    monkeypatch.setattr(piloted, "_TOES", 1)
    result = scored(TASK, experts_machine(TASK), engine, None)
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.metrics["base_shift"] > 0.5


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_parts_that_come_off_end_it(engine) -> None:
    machine, trial = honest(engine)
    assert score(TASK, machine, trial).success
    pieces = trial.pieces.copy()
    pieces[600:, 3] = pieces.max() + 1
    result = score(TASK, machine, replace(trial, pieces=pieces))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("came_apart",)


@pytest.mark.nightly
def test_a_machine_that_moves_its_base_is_flagged() -> None:
    machine, trial = honest("mujoco")
    moved = trial.positions.copy()
    moved[300:, 0, 0] += 0.5
    result = score(TASK, machine, replace(trial, positions=moved))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("base_moved",)


def test_there_are_no_wheels_and_no_fans_to_go_there_with() -> None:
    modules = TASK.constraints.catalogue
    assert not any(module.motor or module.thrust for module in modules.values())
    assert "Flying Block" not in modules


@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_machine_in_the_cargos_place_is_refused(engine) -> None:
    """A row that reaches where the cargo stands; the exact one, and one of another world."""
    for seed, north in ((None, 2), (0, round(TASK.scenario.world(0).cargo.at[1]))):
        draft = KeyedDraft(modules="workshop")
        base = draft.start()
        if north:
            base = draft.row(base, NORTH if north > 0 else SOUTH, abs(north))[-1]
        draft.row(base, WEST, 6)
        machine = draft.machine.with_controller("function control() return {} end")
        with pytest.raises(MachineNotSimulable, match="overlaps the cargo"):
            simulate(machine, TASK.scenario, engine, seed=seed)


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    "stricter",
    [
        {"max_distance": 0.001},
        {"clearance": 2.5},
        {"max_loose": 0.05},
        {"max_base_shift": 0.01},
        {"min_carry": 15},
        {"rest_s": 29},
    ],
    ids=lambda scoring: next(iter(scoring)),
)
def test_each_threshold_decides(stricter) -> None:
    machine, trial = honest("mujoco")
    assert score(TASK, machine, trial).success
    strict = replace(TASK, scoring=TASK.scoring.model_copy(update=stricter))
    assert not score(strict, machine, trial).success


def test_worlds_leave_the_cargo_out_of_the_machines_way_and_its_mark_far_enough() -> None:
    for seed in range(300):
        world = TASK.scenario.world(seed)
        (east, north, _), (x, y, _) = world.cargo.at, world.marks[0].center
        assert -6 <= east <= -3
        assert 3 <= x <= 6
        assert max(abs(north), abs(y)) <= 3
        assert 2 <= world.cargo.mass_at(0.2) <= 6
        assert world.cargo.mass_at(0.2) == world.cargo.final_mass


def test_a_place_that_nobody_can_reach_is_refused(subtests) -> None:
    for scenario, told in [
        ({"cargo": None, "draws": {}}, "has none: give cargo.at"),
        ({"marks": [], "draws": {}}, "there is no mark 'goal'"),
        ({"control": {"mode": "none"}}, "control"),
        ({"duration_s": 2, "draws": {}}, "rest_s 2 is longer"),
    ]:
        with subtests.test(scenario=scenario), pytest.raises(TaskError, match=told):
            load_task(_changed(scenario=scenario))


def _changed(**parts: Any) -> str:
    document = dict(TASK.as_document()) | {"name": "stricter"}
    for part, changes in parts.items():
        document[part] = {**document[part], **changes}
    return json.dumps({key: value for key, value in document.items() if value is not None}) + "\n"
