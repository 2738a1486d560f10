"""A ball that is delivered: what must not count, however far it gets."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any, Final

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.headroom import drafted
from support.machines.piloted import FASTER_FIRST, scored

from buildarena_benchmark import Task, TaskError, builtin_tasks, load_task, score
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, Trajectory, simulate
from buildarena_worker.builtin.designs import couriers
from buildarena_worker.builtin.designs.drafting import DOWN, NORTH, UP

TASK: Final = builtin_tasks()["deliver-1"]


def lax(task: Task = TASK, **scoring: Any) -> Task:
    """A task whose thresholds are others."""
    return replace(task, scoring=task.scoring.model_copy(update=scoring))


@cache
def honest(engine: str) -> tuple[Machine, Trajectory]:
    """The expert's machine, and its trial in the exact world."""
    machine = drafted(couriers.courier(0))
    return machine, simulate(machine, TASK.scenario, engine)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", ["deliver-1", "deliver-2", "deliver-3"])
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_delivers(engine, name) -> None:
    machine, trial = honest(engine)
    task = builtin_tasks()[name]
    result = score(task, machine, trial) if task is TASK else scored(task, machine, engine, None)
    assert result.success
    assert result.flags == ()
    left = 1 - result.metrics["delivered_s"] / task.scenario.duration_s
    assert result.indicator == pytest.approx(1 + left, abs=1e-5)


@pytest.mark.nightly
def test_engines_agree_about_when() -> None:
    times = [score(TASK, *honest(e)).metrics["delivered_s"] for e in FASTER_FIRST]
    assert max(times) < 1.05 * min(times)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_ball_that_is_kicked(engine) -> None:
    """The same car brakes half way, and the ball rolls on over the line."""
    result = scored(TASK, drafted(couriers.courier(0), [(0.4, "UpArrow", 2.4)]), engine, None)
    assert not result.success
    assert result.flags == ("let_go",)
    assert 0.2 < result.indicator < 0.9


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_tower_that_topples_onto_the_ball(engine) -> None:
    """Thirty high, it hits the ball and knocks it away; what lies at the ball afterwards brings it
    no farther."""
    draft = KeyedDraft(modules="workshop")
    top = draft.row(draft.start(), UP, 30)[-1]
    draft.attach(draft.row(top, NORTH, 2)[-1], DOWN, "Log")
    result = scored(TASK, draft.machine, engine, None)
    assert not result.success
    assert result.indicator < 0.2


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_who_does_nothing_delivers_nothing(engine) -> None:
    result = scored(TASK, drafted(couriers.courier(0), []), engine, None)
    assert (result.success, result.indicator, result.flags) == (False, 0.0, ())


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_what_is_too_high_stays_before_the_barrier(engine) -> None:
    high, base = drafted(couriers.courier(0)), "1"
    for _ in range(2):
        block = high.blocks[base]
        (top,) = (f.label for f in block.module.faces if block.face_normal(f.label)[2] > 0.99)
        told = {"base_block": base, "face": top, "new_block": "Small Wooden Block"}
        assert high.act("attach_block_to", told).ok
        base = list(high.blocks)[-1]
    result = scored(builtin_tasks()["deliver-3"], high, engine, None)
    assert not result.success


def test_a_ball_must_be_up_where_a_height_is_asked_for() -> None:
    machine, trial = honest("mujoco")
    assert score(lax(min_height=-0.5), machine, trial).success
    assert not score(lax(min_height=0.5), machine, trial).success


def test_a_part_that_came_off_delivers_nothing() -> None:
    """The starting block is the only piece that counts: the rest of the car has come off."""
    machine, trial = honest("mujoco")
    pieces = trial.pieces.copy()
    pieces[30:, 1:] = pieces.max() + 1
    result = score(TASK, machine, replace(trial, pieces=pieces))
    assert not result.success
    assert result.flags == ("let_go",)


def test_a_ball_that_is_thrown_on_and_caught() -> None:
    """It jumps ahead by two, and the car is at it again later: once is too often."""
    machine, trial = honest("mujoco")
    ball = trial.cargo_position.copy()
    ball[60:90, 1] += 2.0
    result = score(TASK, machine, replace(trial, cargo_position=ball))
    assert not result.success
    assert result.flags == ("let_go",)


def test_a_machine_around_the_ball_is_refused() -> None:
    draft = KeyedDraft(modules="workshop")
    draft.row(draft.row(draft.start(), UP, 1)[-1], NORTH, 7)
    with pytest.raises(MachineNotSimulable, match="overlaps the cargo"):
        simulate(draft.machine, TASK.scenario, "mujoco")


def test_a_delivery_that_nobody_can_make_is_refused(subtests) -> None:
    for part, changes, told in [
        ("scenario", {"gates": []}, "there is no gate 'line': there are none"),
        ("scenario", {"cargo": None}, "needs shape: ball"),
        ("scenario", {"gates": [{"name": "line", "center": [0, 5], "half_width": 6}]}, "already"),
        ("scenario", {"pushes": [{"at_s": 1, "velocity": [0, 5]}]}, "would deliver as well"),
        ("scenario", {"tracked_blocks": ["1"]}, "only if all blocks are tracked"),
        ("scenario", {"control": {"mode": "none"}}, "control"),
    ]:
        with subtests.test(part=part):
            document = dict(TASK.as_document()) | {"name": "other"}
            document[part] = {**document[part], **changes}
            text = json.dumps({key: value for key, value in document.items() if value is not None})
            with pytest.raises(TaskError, match=told):
                load_task(text + "\n")


def test_going_round_with_the_ball_is_no_shorter() -> None:
    """The line is as wide as the statement says: beside it nothing is delivered."""
    machine, trial = honest("mujoco")
    ball, places = trial.cargo_position.copy(), trial.positions.copy()
    ball[:, 0] += 8
    places[:, :, 0] += 8
    aside = replace(trial, cargo_position=ball, positions=places)
    assert not score(TASK, machine, aside).success
