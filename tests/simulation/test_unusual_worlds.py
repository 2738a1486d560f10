"""Scenarios with another gravity, and with drives that are stronger or weaker, on both engines."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.drafts import KeyedDraft
from support.machines.families import beam

from buildarena_geometry import Machine
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.scenario import Control, ReleasedPlacement
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST

FAN = "Flying Block"


def heavy_car() -> Machine:
    """A car whose wheels' torque decides how fast it gets going, not their grip."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way in (NORTH, SOUTH):
        row = draft.row(middle, way, 7)
        for block in row[:5]:
            for side in (EAST, WEST):
                draft.row(block, side, 4)
        for side in (EAST, WEST):
            draft.bind(draft.wheel(row[-1], side), "spinning_forward", "Alpha1")
    draft.press("Alpha1", 1.0, 3.0)
    return draft.machine


def lifter() -> Machine:
    draft = KeyedDraft(modules="workshop")
    draft.bind(draft.attach(draft.start(), UP, FAN), "fly", "Alpha1")
    draft.press("Alpha1", 0.04, 5.0)
    return draft.machine


@pytest.mark.parametrize("gravity", [10.0, GRAVITY, 60.0])
def test_what_is_let_go_falls_by_the_scenarios_gravity(engine, beam, gravity) -> None:
    scenario = Scenario(duration_s=1, placement=ReleasedPlacement(height=90), gravity=gravity)
    trajectory = simulate(beam, scenario, engine)
    drag = 0.2
    time_s = float(trajectory.time_s[-1])
    fallen = gravity / drag * (time_s - (1 - np.exp(-drag * time_s)) / drag)
    path = trajectory.positions[:, 0, 2].astype(np.float64)
    assert path[0] - path[-1] == pytest.approx(fallen, rel=0.02)
    assert trajectory.settings["gravity"] == gravity


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("gravity", [10.0, 60.0])
def test_bearing_is_in_weights_and_joints_bear_the_true_weight(engine, gravity) -> None:
    machine = beam(5)
    usual, other = (
        simulate(machine, Scenario(duration_s=4, gravity=g), engine) for g in (GRAVITY, gravity)
    )
    for trajectory in (usual, other):
        assert trajectory.bearing.ground[-25:].mean() == pytest.approx(machine.mass, rel=0.02)
    draft = KeyedDraft()
    middle = draft.start()
    draft.row(draft.row(middle, UP, 2)[-1], EAST, 5)
    draft.row(middle, EAST, 4)
    draft.row(middle, WEST, 3)
    overhang = draft.machine
    settled = [
        simulate(overhang, Scenario(duration_s=3, gravity=g), engine).joint_loads[-1].max()
        for g in (GRAVITY, gravity)
    ]
    assert settled[1] / settled[0] == pytest.approx(gravity / GRAVITY, rel=0.1)


@pytest.mark.parametrize(("gravity", "strength"), [(20.0, 1.0), (GRAVITY, 0.8), (40.0, 1.5)])
def test_fans_push_by_their_strength_whatever_the_gravity_is(engine, gravity, strength) -> None:
    machine = lifter()
    scenario = Scenario(
        duration_s=1,
        placement=ReleasedPlacement(height=50),
        control=Control(mode="agent"),
        gravity=gravity,
        drive_strength=strength,
    )
    trajectory = simulate(machine, scenario, engine)
    path = trajectory.positions[:, 0, 2].astype(np.float64)
    early = slice(3, 9)
    bend = np.polyfit(trajectory.time_s[early], path[early], 2)[0] * 2
    expected = 3.25 * GRAVITY * strength / machine.mass - gravity
    assert bend == pytest.approx(expected, rel=0.12, abs=2.0)


def test_motors_drive_by_their_strength(engine) -> None:
    """How fast a heavy car gets going, far below its motors' speed."""
    machine = heavy_car()
    for strength in (0.1, 0.15):
        scenario = Scenario(duration_s=2, control=Control(mode="agent"), drive_strength=strength)
        trajectory = simulate(machine, scenario, engine)
        path = trajectory.positions[:, 0, 1].astype(np.float64)
        going = (trajectory.time_s > 1.15) & (trajectory.time_s < 1.5)
        gains = np.polyfit(trajectory.time_s[going], path[going], 2)[0] * 2
        # Four wheels of radius 1; what turns is as slow to turn as it is to move, half of it.
        expected = 4 * 20 * strength * GRAVITY / (machine.mass + 4 * 0.5)
        assert gains == pytest.approx(expected, rel=0.15)
        assert trajectory.settings["drive_strength"] == strength


def test_usual_worlds_are_what_they_were(engine, beam) -> None:
    usual = Scenario(duration_s=1)
    told = Scenario(duration_s=1, gravity=GRAVITY, drive_strength=1)
    assert usual.model_dump_json() == told.model_dump_json()
    assert "gravity" not in usual.model_dump_json()
    assert "drive_strength" not in simulate(beam, usual, engine).settings


@pytest.mark.parametrize(
    "given",
    [
        {"gravity": 0},
        {"gravity": 101},
        {"gravity": float("nan")},
        {"drive_strength": 0},
        {"drive_strength": 11},
        {"drive_strength": float("inf")},
    ],
)
def test_worlds_are_bounded(given) -> None:
    with pytest.raises(ValidationError, match=next(iter(given))):
        Scenario(duration_s=1, **given)
