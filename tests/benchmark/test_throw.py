"""A boulder that is thrown: what must not count, however far it flies."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np
import pytest
from support.machines.boulders import car_with_boulder
from support.machines.drafts import KeyedDraft
from support.machines.headroom import drafted
from support.machines.piloted import (
    FASTER_FIRST,
    experts_machine,
    listened,
    repeated,
    scored,
)

from buildarena_benchmark import Task, TaskError, builtin_tasks, load_task, score
from buildarena_benchmark.constraints import broken_constraint
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, Trajectory, simulate
from buildarena_worker.builtin.designs import throwers
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST, Draft

TASK: Final = builtin_tasks()["throw-1"]
BEST_PUBLISHED: Final = 9.8
"""The best published mean of the peer's catapults, units."""


def lax(task: Task = TASK, **scoring: Any) -> Task:
    """A task whose thresholds are others."""
    return replace(task, scoring=task.scoring.model_copy(update=scoring))


def experts(presses: Any = None) -> Machine:
    return drafted(throwers.catapult(0), presses, modules="all")


@cache
def honest(engine: str) -> tuple[Machine, Trajectory]:
    """The expert's machine, and its trial in the exact world."""
    machine = experts()
    return machine, simulate(machine, TASK.scenario, engine)


def index_of(machine: Machine, module: str) -> int:
    """The first block of a module."""
    return [block.module.name for block in machine.blocks.values()].index(module)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_throws_five_times_as_far_as_the_best_published(engine) -> None:
    machine, trial = honest(engine)
    assert broken_constraint(TASK, machine) is None
    result = score(TASK, machine, trial)
    assert result.success
    assert result.flags == ()
    assert result.indicator > 5 * BEST_PUBLISHED
    assert result.metrics["flight_error"] < 0.001
    assert result.metrics["energy"] < result.metrics["work"]


def test_the_published_score_is_told_beside_it() -> None:
    """Its distance times 1 + how far it rose, 0 below a height of 3 or where it was brought."""
    machine, trial = honest(FASTER_FIRST[0])
    metrics, ball = score(TASK, machine, trial).metrics, index_of(machine, "Boulder")
    path = trial.positions[:, ball]
    distance = metrics["distance"] + TASK.scenario.gates[0].center[1] - path[0, 1]
    rise = path[:, 2].max() - path[0, 2]
    assert rise > 10
    assert metrics["parabola"] == pytest.approx(distance * (1 + rise), rel=0.02)


@pytest.mark.nightly
def test_engines_agree_about_how_far_it_flies() -> None:
    near, far = sorted(score(TASK, *honest(engine)).indicator for engine in FASTER_FIRST)
    assert far < 1.1 * near


def fails(result: Any, *flags: str) -> None:
    assert (result.success, result.indicator) == (False, 0.0), result
    assert set(flags) <= set(result.flags), result


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_throwing_by_collapse(engine, monkeypatch) -> None:
    """The same catapult on a post that breaks while it throws, and a mast that topples over."""
    monkeypatch.setattr(throwers, "_stays", _too_few_stays)
    fails(scored(TASK, experts(), engine, None), "came_apart")
    draft = KeyedDraft(modules="all")
    top = draft.row(draft.row(draft.start(), UP, 3)[-1], NORTH, 1)[-1]
    draft.attach(draft.attach(top, UP, "Bomb Holder"), UP, "Boulder")
    topples = lax(min_distance=0.0, max_start_height=50.0)
    fails(scored(topples, draft.machine, engine, None))


def _too_few_stays(draft: Draft, beam: list[str], post: list[str], west: str) -> None:
    """The post is held along the foot and not across: it breaks when the arm is half way up."""
    del west
    for base, way in ((beam[2], NORTH), (beam[1], NORTH), (beam[10], SOUTH)):
        draft.connect(post[-1], base, way, UP)
    for side in (EAST, WEST):
        draft.connect(beam[5], beam[9], side)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_boulder_that_begins_inside_its_cup(engine) -> None:
    """Engines part what overlaps. It hops no higher than this, and whoever does so is refused."""
    still = experts([])
    boulder = index_of(still, "Boulder")
    for machine in (still, thrown := experts()):
        move = {"block_id": list(machine.blocks)[boulder], "shift_real": [0, 0, -0.45]}
        assert machine.act("shift_block", move).ok
    heights = simulate(still, TASK.scenario, engine).positions[:50, boulder, 2]
    assert heights.max() < heights[-1] + 0.2
    fails(scored(TASK, thrown, engine, None), "unexplained")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_throwing_by_driving(engine) -> None:
    """A car that carries the boulder north and brakes at the line."""
    result = scored(lax(min_distance=0.0), car_with_boulder(), engine, None)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_fence_is_cleared_or_not(engine) -> None:
    """The same throw leaves a fence of 3 untouched; one of 40 is what it touches first."""
    fenced = builtin_tasks()["throw-2"]
    machine, trial = honest(engine)
    over = scored(fenced, machine, engine, None)
    assert over.success
    assert over.indicator == pytest.approx(score(TASK, machine, trial).indicator, abs=0.5)
    north, *rest = fenced.scenario.terrain
    wall = north.model_copy(update={"center": (0, 5.5, 20), "size": (24, 1, 40)})
    terrain = {"terrain": (wall, *rest)}
    walled = replace(fenced, scenario=fenced.scenario.model_copy(update=terrain))
    against = scored(walled, machine, engine, None)
    assert not against.success
    assert 2 < against.metrics["distance"] < 4


def test_a_machine_in_the_fences_place_is_refused() -> None:
    draft = KeyedDraft(modules="all")
    draft.attach(draft.row(draft.start(), EAST, 11)[-1], UP, "Boulder")
    with pytest.raises(MachineNotSimulable, match="overlaps terrain 3"):
        simulate(draft.machine, builtin_tasks()["throw-2"].scenario, "mujoco")


RING: Final = builtin_tasks()["throw-3"]
FAR, NEAR = 6, 3
"""Seeds whose rings lie at 40.7 and 17.1."""


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("seed", [None, FAR, NEAR])
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_hits_the_ring_wherever_it_lies(engine, seed) -> None:
    result = scored(RING, experts_machine(RING), engine, seed)
    assert result.success
    assert result.indicator == pytest.approx(1 / (1 + result.metrics["miss"]), abs=1e-5)
    assert result.metrics["miss"] <= RING.scenario.marks[0].radius


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_who_throws_as_in_the_exact_world_misses_where_the_ring_is_elsewhere(engine) -> None:
    machine = experts_machine(RING)
    exact, answers = listened(RING, machine, engine)
    assert exact.success
    elsewhere = repeated(answers, RING, machine, engine, FAR)
    assert not elsewhere.success
    assert elsewhere.metrics["miss"] > 8
    assert elsewhere.indicator < 0.12


STANDING: Final = builtin_tasks()["throw-4"]
TWO: Final = builtin_tasks()["throw-5"]


@pytest.mark.nightly
@pytest.mark.parametrize("task", [STANDING, TWO], ids=lambda task: task.name)
@pytest.mark.parametrize("seed", [None, 8, 11])
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_throws_through_its_rings_however_high_they_stand(engine, seed, task) -> None:
    """Seeds whose last rings stand at 16.4 and 11.3."""
    result = scored(task, experts_machine(task), engine, seed)
    rings = len(task.scoring.rings)
    assert result.success
    assert result.metrics["rings"] == rings
    assert rings < result.indicator < 2 * rings


@pytest.mark.nightly
def test_a_ring_is_passed_in_the_air_and_with_all_of_the_boulder() -> None:
    """The same flight by rings beside it, so small that it would touch them, and behind its end."""
    machine = experts_machine(STANDING)
    trial = simulate(machine, STANDING.scenario, "mujoco")
    assert score(STANDING, machine, trial).success
    (ring,) = STANDING.scenario.marks
    for changed in ({"center": (4, 24, 12)}, {"radius": 0.9}, {"center": (0, 60, 12)}):
        marks = (ring.model_copy(update=changed),)
        task = replace(STANDING, scenario=STANDING.scenario.model_copy(update={"marks": marks}))
        result = score(task, machine, trial)
        assert (result.success, result.indicator, result.metrics["rings"]) == (False, 0.0, 0)


def test_one_ring_of_two_counts_and_is_no_success() -> None:
    machine = experts_machine(TWO)
    trial = simulate(machine, TWO.scenario, "mujoco")
    marks = {mark.name: mark for mark in TWO.scenario.marks}
    aside = marks["near"].model_copy(update={"center": (5, 8, 23)})
    scenario = TWO.scenario.model_copy(update={"marks": (aside, marks["ring"])})
    result = score(replace(TWO, scenario=scenario), machine, trial)
    assert (result.success, result.metrics["rings"]) == (False, 1)
    assert 1.0 < result.indicator < 2.0


@pytest.mark.nightly
def test_who_throws_as_in_the_exact_world_misses_a_higher_ring() -> None:
    machine = experts_machine(STANDING)
    exact, answers = listened(STANDING, machine, "mujoco")
    assert exact.success
    assert not repeated(answers, STANDING, machine, "mujoco", 8).success


def test_rings_lie_where_the_statement_tells() -> None:
    places = [RING.scenario.world(seed).marks[0].center for seed in range(200)]
    assert {(x, z) for x, _, z in places} == {(0, 0)}
    assert all(17 <= north <= 42 for _, north, _ in places)
    assert max(north for _, north, _ in places) - min(north for _, north, _ in places) > 23


def test_what_pushes_by_itself_is_no_part_of_the_task() -> None:
    machine, trial = honest("mujoco")
    assert not any(m.thrust or m.greatest_push for m in TASK.constraints.catalogue.values())
    draft = KeyedDraft(modules="all")
    draft.cannon(draft.start(), UP, SOUTH)
    assert "not among the task's modules" in broken_constraint(TASK, draft.machine)[1]
    armed = experts()
    armed.act("attach_block_to", {"base_block": "1", "face": "C", "new_block": "Water Cannon"})
    positions = np.concatenate([trial.positions, trial.positions[:, :1]], axis=1)
    more = replace(
        trial,
        block_ids=(*trial.block_ids, list(armed.blocks)[-1]),
        positions=positions,
        quaternions=np.concatenate([trial.quaternions, trial.quaternions[:, :1]], axis=1),
        pieces=np.concatenate([trial.pieces, trial.pieces[:, :1]], axis=1),
    )
    fails(score(TASK, armed, more), "thrust_used")
    assert len(armed.blocks) == len(machine.blocks) + 1


def test_a_boulder_has_no_more_energy_than_it_was_given() -> None:
    """The expert's flight from a machine that has no springs."""
    machine, trial = honest("mujoco")
    without = machine.copy()
    for link in machine.connectors.values():
        if link.module.name == "Spring":
            assert without.act("remove_block", {"block_id": link.id}).ok
    fails(score(TASK, without, trial), "unexplained")


def later(trial: Trajectory, block: int, change: Callable[[np.ndarray], np.ndarray]) -> Trajectory:
    """A trial in which a block is somewhere else: (T, 3) of what it adds to time, from 0."""
    moved = trial.positions.copy()
    moved[:, block] += change(trial.time_s).astype(moved.dtype)
    return replace(trial, positions=moved)


def after(time_s: float, shift: tuple[float, float, float]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: np.outer(t >= time_s, shift)


def test_a_trial_that_breaks_one_rule(subtests) -> None:
    for part, change, flag in [
        (5, after(2.4, (0, 9, 0)), "crossed_line"),
        (0, after(1.0, (0, -3.05, 0)), "base_moved"),
        ("Boulder", after(2.6, (0, 3, 0)), "not_free"),
        ("Boulder", lambda t: np.outer((t > 1.2) & (t < 1.3), (0, -2.0, 2.0)), "not_borne"),
    ]:
        with subtests.test(part=part):
            machine, trial = honest("mujoco")
            block = part if isinstance(part, int) else index_of(machine, part)
            result = score(TASK, machine, later(trial, block, change))
            fails(result)
            assert result.flags == (flag,)


def test_recoil_after_the_throw_does_not_count() -> None:
    """Engines part in what the machine does once the boulder is away: so it decides nothing."""
    machine, trial = honest("mujoco")
    release_s = score(TASK, machine, trial).metrics["release_s"]
    hops = later(trial, 0, after(release_s + 0.08, (0, -5, 0)))
    assert score(TASK, machine, hops).success


def test_what_is_thrown_by_parts_that_fly_along() -> None:
    """The cup has come off: what flies on with the boulder bears nothing."""
    machine, trial = honest("mujoco")
    pieces = trial.pieces.copy()
    pieces[30:, index_of(machine, "Bomb Holder")] = pieces.max() + 1
    fails(score(TASK, machine, replace(trial, pieces=pieces)), "not_borne")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_boulder_is_borne_for_a_second_first(engine) -> None:
    fails(scored(TASK, experts([(0.2, "Alpha1", 4.0)]), engine, None), "not_borne")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_who_lets_it_lie_or_drops_it_throws_nothing(engine) -> None:
    """Nobody presses a key; it lies in no cup."""
    fails(scored(TASK, experts([]), engine, None))
    draft = KeyedDraft(modules="all")
    draft.attach(draft.row(draft.start(), UP, 2)[-1], NORTH, "Boulder")
    fails(scored(lax(min_distance=0.0), draft.machine, engine, None))


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    "stricter",
    [
        {"min_distance": 500},
        {"borne_s": 3},
        {"max_base_shift": 0.01},
        {"max_tilt_deg": 0.1},
        {"max_start_height": 1},
        {"max_error": 1e-6},
    ],
    ids=lambda scoring: next(iter(scoring)),
)
def test_each_threshold_decides(stricter) -> None:
    assert not score(lax(**stricter), *honest("mujoco")).success


def test_a_throw_that_nobody_can_make_is_refused(subtests) -> None:
    for part, changes, told in [
        ("scenario", {"gates": []}, "there is no gate 'line': there are none"),
        ("scoring", {"target": "ring"}, "there is no mark 'ring'"),
        ("scoring", {"rings": ["hoop"]}, "there is no mark 'hoop'"),
        ("scenario", {"placement": {"kind": "released", "height": 5}}, "is not ground"),
        ("scenario", {"gusts": {"strength": 2}}, "would throw as well"),
        ("scenario", {"tracked_blocks": ["1"]}, "only if all blocks are tracked"),
        ("scoring", {"borne_s": 20}, "borne_s 20 is longer"),
        ("scenario", {"control": {"mode": "none"}}, "control"),
    ]:
        with subtests.test(part=part):
            document = dict(TASK.as_document()) | {"name": "other"}
            document[part] = {**document[part], **changes}
            text = json.dumps({key: value for key, value in document.items() if value is not None})
            with pytest.raises(TaskError, match=told):
                load_task(text + "\n")
