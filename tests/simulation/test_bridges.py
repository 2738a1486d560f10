"""Bridges: which carries more, whichever way they stand, and what earns nothing more."""

import itertools
from collections.abc import Sequence
from typing import Any

import pytest
from benchmarks.agreement import compared
from support.machines.drafts import KeyedDraft
from support.machines.families import beam, deck
from support.machines.random_machines import TASKS
from support.machines.references import load_machine
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark import Task
from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_simulation.scenario import SpanPlacement, TerrainBox, gap_terrain
from buildarena_worker.builtin.designs.drafting import BRACE, EAST, NORTH, SOUTH, UP, WEST


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_more_bracing_carries_more(engine, tasks) -> None:
    beams = [beam(7, braces) for braces in ("", "t", "tb", "12")]
    loads = [trial(tasks["support-1"], actions, engine)[0].indicator for actions in beams]
    assert loads == sorted(loads)
    assert all(b > 1.2 * a for a, b in itertools.pairwise(loads))


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_the_one_shot_bridge_breaks_where_the_paper_reports_its_load(engine, tasks) -> None:
    # Over a gap so deep that its pillars hang free; over the task's they stand on the floor.
    deep = tasks["support-1"].scenario.model_copy(
        update={
            "terrain": gap_terrain(5.0, height=25.0),
            "placement": SpanPlacement(gap=5.0, lowest_center=26.0),
        }
    )
    first = simulate(load_machine("one-shot-bridge"), deep, engine).breaks[0]
    assert first.cargo_mass == pytest.approx(1000.0, rel=0.03)


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_overlap_on_the_terrain_never_hurts(engine, tasks) -> None:
    loads = [
        trial(tasks["support-1"], beam(length, "t"), engine)[0].metrics["load_at_first_break"]
        for length in (7, 11, 25)
    ]
    assert loads == sorted(loads)
    assert loads[-1] < 1.1 * loads[0]


def _beam_with(
    braces: Sequence[tuple[int, int]], length: int = 7, connector: str = BRACE
) -> Machine:
    draft = KeyedDraft()
    middle = draft.start()
    ahead = draft.row(middle, NORTH, length // 2)
    row = [*reversed(draft.row(middle, SOUTH, length // 2)), middle, *ahead]
    for first, second in braces:
        draft.connect(row[first], row[second], UP, connector=connector)
    return draft.machine


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(
    "spans",
    [
        ((0, 3), (3, 6)),
        nightly(((0, 6),)),
        nightly(((0, 6), (0, 5), (1, 6), (1, 5))),
        nightly(tuple((k, k + 1) for k in range(6))),
    ],
)
def test_connectors_stacked_on_the_same_faces_are_worth_one(engine, tasks, spans) -> None:
    task = tasks["support-1"]
    once, often = (trial(task, _beam_with(spans * n), engine)[0].metrics for n in (1, 5))
    assert often["load_at_first_break"] <= 1.02 * once["load_at_first_break"]
    assert trial(task, _beam_with(spans * 5), engine)[0].indicator < 1000.0


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_winches_stacked_between_the_same_faces_are_one_rope(engine, tasks) -> None:
    spans = ((0, 3), (3, 6), (0, 6))
    loads = [
        trial(tasks["support-1"], _beam_with(spans * n, connector="Winch"), engine)[0].indicator
        for n in (1, 4)
    ]
    assert loads[1] <= 1.05 * loads[0]


TOLERANCE = {"mujoco": 0.02, "pybullet": 0.05}


def _turned(machine: Machine, yaw_deg: float) -> Machine:
    whole = Machine(available={"m": machine})
    assert whole.act("add_machine", {"machine_id": "m", "init_rotation": [yaw_deg, 0, 0]}).ok
    return whole


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("yaw_deg", [90, nightly(180), nightly(270)])
def test_a_turned_bridge_carries_the_same(engine, tasks, yaw_deg) -> None:
    task = tasks["support-1"]
    for machine in (deck(5, 7), beam(9, "t")):
        # A deck is as long across as along, so the gap turns with it.
        terrain = task.scenario.terrain
        if yaw_deg != 180:
            terrain = tuple(_turned_box(box) for box in terrain)
        straight = trial(task, machine, engine)[0].metrics["load_at_first_break"]
        changes = {"terrain": terrain, **_unturned(task)}
        turned, _ = trial(task, _turned(machine, yaw_deg), engine, **changes)
        found = turned.metrics["load_at_first_break"]
        assert found == pytest.approx(straight, rel=TOLERANCE[engine])


def _turned_box(box: TerrainBox) -> TerrainBox:
    x, y, z = box.center
    width, length, height = box.size
    return TerrainBox(center=(-y, x, z), size=(length, width, height))


def _unturned(task: Task) -> dict[str, Any]:
    """A placement that never turns a machine: none is longer than this gap."""
    return {"placement": task.scenario.placement.model_copy(update={"gap": 99.0})}


def _turning_car(*, mirrored: bool) -> Machine:
    """A car that drives ahead with its wheels on one side a little longer."""
    draft = KeyedDraft()
    middle = draft.start()
    front, back = draft.row(middle, NORTH, 2)[-1], draft.row(middle, SOUTH, 2)[-1]
    fast, slow = (WEST, EAST) if mirrored else (EAST, WEST)
    for side, key in ((fast, "UpArrow"), (slow, "DownArrow")):
        for base in (front, back):
            wheel = draft.wheel(draft.row(base, side, 1)[-1], side)
            draft.bind(wheel, "spinning_forward", key)
    draft.press("UpArrow", 1.0, 1.2)
    draft.press("DownArrow", 1.0, 1.0)
    return draft.machine


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_mirrored_car_drives_as_far(engine, tasks) -> None:
    task = tasks["transport-1"]
    found = [trial(task, _turning_car(mirrored=m), engine)[0] for m in (False, True)]
    assert found[0].success == found[1].success
    assert found[0].indicator == pytest.approx(found[1].indicator, rel=TOLERANCE[engine])


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    "task", [nightly(task) if task in {"transport-2", "transport-3"} else task for task in TASKS]
)
def test_engines_agree_on_machines_that_nobody_chose(task) -> None:
    result = compared("basic", task, seed=5)
    assert result.same
    assert result.close
