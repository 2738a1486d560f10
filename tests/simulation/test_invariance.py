"""The same machine turned or mirrored does the same; engines agree on machines nobody chose."""

from typing import Any

import pytest
from benchmarks.agreement import compared
from support.machines.drafts import KeyedDraft
from support.machines.families import beam, deck
from support.machines.random_machines import TASKS, random_machine
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark import Task
from buildarena_geometry import Machine
from buildarena_simulation.scenario import TerrainBox
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, WEST

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


def test_equal_seeds_draw_equal_machines() -> None:
    first, again, other = (random_machine("support-2", seed).log for seed in (3, 3, 4))
    assert [r.arguments for r in first] == [r.arguments for r in again]
    assert [r.arguments for r in first] != [r.arguments for r in other]
