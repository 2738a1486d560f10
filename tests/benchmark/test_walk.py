"""Walking: what must not count, however far it gets."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.piloted import FASTER_FIRST, experts_machine, scored

from buildarena_benchmark import TaskError, builtin_tasks, load_task, score
from buildarena_benchmark.scorers.measures.walking import links_of, touching, walked
from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Direction

WALK: Final = builtin_tasks()["walk-1"]
CORNER: Final = builtin_tasks()["walk-2"]
LEVEL: Final = {"placement": {"kind": "ground"}, "terrain": [], "draws": {}}
"""The same trial on flat ground, facing north: what fails there fails by its rule."""


def changed(task: Any, **parts: Mapping[str, Any]) -> Any:
    document = dict(task.as_document()) | {"name": "other"}
    for part, changes in parts.items():
        document[part] = {**document[part], **changes}
    text = json.dumps({key: value for key, value in document.items() if value is not None})
    return load_task(text + "\n")


EASY: Final = changed(WALK, scenario=LEVEL)
PUSHED: Final = changed(
    WALK,
    scenario=LEVEL | {"pushes": [{"at_s": 1 + 1.5 * k, "velocity": [0, 12]} for k in range(12)]},
)


def moved_by(draft: KeyedDraft, answer: str) -> Machine:
    return draft.machine.with_controller(f"function control(t, sense) return {{ {answer} }} end")


def chain(draft: KeyedDraft, base: str, way: Direction, count: int) -> list[str]:
    made = []
    for _ in range(count):
        base = draft.attach(base, way, "Piston")
        made.append(base)
    return made


def telescope() -> Machine:
    """Stands still on a wide base, and pushes its starting block ten units north."""
    draft = KeyedDraft(modules="workshop")
    base = draft.row(chain(draft, draft.start(), SOUTH, 10)[-1], SOUTH, 3)[-1]
    for way in (EAST, WEST):
        draft.row(base, way, 4)
    return moved_by(draft, "extend = 1")


def mast() -> Machine:
    """Stands on a narrow foot, its starting block on the top, and falls northwards."""
    draft = KeyedDraft(modules="workshop")
    base = draft.start()
    for _ in range(4):
        base = draft.attach(base, DOWN, "Log")
    hinge = draft.attach(base, DOWN, "Steering Hinge")
    draft.turn_axis(hinge, 0, WEST)
    foot = draft.attach(hinge, DOWN)
    for way in (EAST, WEST):
        draft.row(foot, way, 1)
    return moved_by(draft, "turn_right = 1")


def long_nose() -> Machine:
    """Long to the north: its nose is beyond the way from the start on."""
    draft = KeyedDraft(modules="workshop")
    draft.row(draft.start(), NORTH, 12)
    return moved_by(draft, "")


def scooter() -> Machine:
    """Two blocks on a row of pistons, which pull and push each other and never leave the ground."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for way in (EAST, WEST):
        draft.row(start, way, 2)
    draft.attach(chain(draft, start, NORTH, 2)[-1], NORTH)
    return moved_by(draft, "extend = t % 1 < 0.7 and 0.4 or 0")


def leaper() -> Machine:
    """Leans on rows of pistons, whose joint push throws it ahead."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for side in (EAST, WEST):
        hinge = draft.attach(draft.row(start, side, 2)[-1], DOWN, "Steering Hinge")
        draft.turn_axis(hinge, 0, EAST)
        foot = draft.attach(chain(draft, hinge, DOWN, 3)[-1], DOWN)
        for way in (NORTH, SOUTH):
            draft.row(foot, way, 1)
    return moved_by(draft, "extend = t % 2 < 0.6 and 1 or 0, turn_left = t < 0.2 and 1 or 0")


def sled() -> Machine:
    """A flat board with a hinge, so that it has two links."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for way in (EAST, WEST, NORTH):
        draft.row(start, way, 2)
    hinge = draft.attach(start, SOUTH, "Steering Hinge")
    draft.turn_axis(hinge, 0, UP)
    draft.attach(hinge, SOUTH)
    return moved_by(draft, "")


def walker(answer: str) -> Machine:
    """The expert's machine, which acts in another way: hinge 4, slides 5 and 6, lifts 7 and 8."""
    machine = experts_machine(WALK)
    assert [machine.blocks[block].module.name for block in "45678"] == [
        "Steering Hinge",
        *["Piston"] * 4,
    ]
    return machine.with_controller(f"function control(t, sense) return {{ {answer} }} end")


LIFTS: Final = '["7.extend"] = %s, ["8.extend"] = %s'


def trembler() -> Machine:
    """Trembles on its lifts, both frames on the ground."""
    share = 'sense.joints["7"].length < 0.5 and 1 or 0'
    return walker(LIFTS % (share, share))


def stepper() -> Machine:
    """Lifts its feet in turn, and does not move ahead."""
    share = "t % 3 < 1.5 and 1 or 0"
    return walker(LIFTS % (share, share))


MACHINES: Final = {
    "telescope": telescope,
    "mast": mast,
    "long nose": long_nose,
    "scooter": scooter,
    "leaper": leaper,
    "sled": sled,
    "trembler": trembler,
    "stepper": stepper,
}
FAR: Final = ("telescope", "mast")
"""The starting blocks of these get far enough all the same."""


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("name", MACHINES)
def test_what_does_not_walk_does_not_pass(name, engine) -> None:
    machine = MACHINES[name]()
    trial = simulate(machine, EASY.scenario, engine)
    result = score(EASY, machine, trial)
    assert not result.success, result
    assert result.indicator < 1, result
    came = float((trial.positions[:, 0, 1] - trial.positions[0, 0, 1]).max())
    assert (came > EASY.scoring.min_distance) == (name in FAR)
    assert ("not_walked" in result.flags) == (name in FAR)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("name", ["sled", "trembler", "stepper"])
def test_who_is_pushed_and_slides_does_not_walk(name, engine) -> None:
    """Even where its feet are lifted in turn meanwhile: a link that slides carries nothing."""
    machine = MACHINES[name]()
    trial = simulate(machine, PUSHED.scenario, engine)
    result = score(PUSHED, machine, trial)
    assert float(trial.positions[:, 0, 1].max()) > 8
    assert not result.success, result
    assert result.indicator < 3, result


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("task", [WALK, CORNER], ids=lambda task: task.name)
def test_who_does_nothing_or_walks_on_without_looking_does_not_pass(task, engine) -> None:
    machine = experts_machine(task)
    idle = machine.with_controller("function control() return {} end")
    assert scored(task, idle, engine, 1).indicator < 0.5
    ahead = machine.controller.replace("math.atan(sense.forward.x, sense.forward.y) - way", "0")
    assert not scored(task, machine.with_controller(ahead), engine, None).success


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_feet_take_turns_and_the_least_of_all_counts(engine) -> None:
    machine = experts_machine(WALK)
    trial = simulate(machine, EASY.scenario, engine)
    links = links_of(machine, trial)
    assert len(set(links.tolist())) == 6  # a body, a frame, a hinge's far side, and between pistons
    touches = touching(EASY.scenario, machine, trial, links)
    assert touches.any(axis=0).sum() == 2
    assert (touches.sum(axis=1) == 1).mean() > 0.7
    result = score(EASY, machine, trial)
    came = float(trial.positions[:, 0, 1].max())
    assert 8 < result.indicator < came + 0.01
    north = walked(machine, trial, links, touches, axis=1, since=0)
    assert result.indicator == pytest.approx(float(north.max()), abs=1e-5)


@pytest.mark.nightly
def test_a_part_that_comes_off_ends_the_walk() -> None:
    """The same trial, in which a foot stays behind early on."""
    machine = experts_machine(WALK)
    trial = simulate(machine, EASY.scenario, "mujoco")
    assert score(EASY, machine, trial).success
    pieces = trial.pieces.copy()
    pieces[100:, -1] = pieces.max() + 1
    result = score(EASY, machine, replace(trial, pieces=pieces))
    assert (result.success, result.flags) == (False, ("came_apart",))
    assert result.indicator < 8


@pytest.mark.nightly
def test_each_threshold_ends_a_walk(subtests) -> None:
    for stricter in [{"max_tilt_deg": 1}, {"max_part_tilt_deg": 1}, {"lane": 0.01}]:
        with subtests.test(stricter=stricter):
            machine = experts_machine(WALK)
            trial = simulate(machine, WALK.scenario, "mujoco")
            assert score(WALK, machine, trial).success
            result = score(changed(WALK, scoring=stricter), machine, trial)
            assert (result.success, result.flags) == (False, ("not_walked",))


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_corner_must_be_walked_to_and_round(engine) -> None:
    """Who only walks north, or east at once, does not pass, and north counts to the corner."""
    machine = experts_machine(CORNER)
    assert scored(CORNER, machine, engine, None).success
    for aim in ("return 0, 2", "return math.pi / 2, 2"):
        straight = machine.with_controller(
            machine.controller.replace("local corner = sense", f"do {aim} end local corner = sense")
        )
        result = scored(CORNER, straight, engine, None)
        assert not result.success, result
        assert result.indicator < 6


def test_a_walk_that_nobody_can_take_is_refused(subtests) -> None:
    for scoring, scenario, told in [
        (
            {},
            {"placement": {"kind": "released", "height": 5}, "draws": {}},
            "not put on the ground",
        ),
        ({}, {"control": {"mode": "none"}}, "control"),
        ({"corner": "nowhere"}, {}, "no mark 'nowhere'"),
        ({"corner_slack": 6}, {}, "not north of the start"),
    ]:
        with subtests.test(scoring=scoring), pytest.raises(TaskError, match=told):
            changed(CORNER, scoring=scoring, scenario=scenario)
