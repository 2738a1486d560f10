"""Balloons on their ropes, balloons that hold a height, and springs, on both engines."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.machines.trials import press

from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST
from buildarena_benchmark.scoring.measures.components import joined_to_start
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.modules.sets import module_set
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control
from buildarena_simulation.trajectory import Break

WORKSHOP = module_set("workshop")
DRIVEN = Control(mode="agent")


def _stood(machine: Machine, engine: str, seconds: float, *keys: KeyPress) -> Trajectory:
    return simulate(machine, Scenario(duration_s=seconds, control=DRIVEN), engine, controls=keys)


def _foot(draft: KeyedDraft) -> str:
    start = draft.start()
    for side in (EAST, WEST, NORTH, SOUTH):
        draft.row(start, side, 2)
    return start


def test_a_balloon_stands_over_its_rope_and_pulls_what_it_can(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    balloon = draft.attach(_foot(draft), UP, "Balloon")
    module = WORKSHOP["Balloon"]
    trajectory = _stood(draft.machine, engine, 8.0)
    top = trajectory.positions[-1, 0, 2] + 0.5
    at = trajectory.positions[-1, trajectory.block_ids.index(balloon)]
    assert not trajectory.breaks
    assert at[2] - top == pytest.approx(module.rope_mount.length + module.center[2], rel=0.02)
    assert np.abs(at[:2] - trajectory.positions[-1, 0, :2]).max() < 0.05
    net = module.lift.force - module.mass
    weight = structure_of(draft.machine).masses.sum() - module.lift.force
    assert trajectory.bearing.ground[-25:].mean() == pytest.approx(weight, rel=0.02)
    assert trajectory.joint_loads[-25:, -1].mean() * 1000 == pytest.approx(net, abs=1.96)


def _aloft(load: int) -> tuple[Machine, str]:
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    draft.row(start, DOWN, load)
    balloon = draft.attach(start, UP, "Sqr Balloon")
    draft.bind(balloon, "rise", "UpArrow")
    draft.bind(balloon, "sink", "DownArrow")
    return draft.machine, balloon


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("load", [6, 0, 14])
def test_a_balloon_holds_the_height_that_its_keys_ask_for(engine, load) -> None:
    machine, balloon = _aloft(load)
    altitude = WORKSHOP["Sqr Balloon"].altitude
    keys = (press("UpArrow", 1.0, 4.0), press("DownArrow", 9.0, 1.0))
    trajectory = _stood(machine, engine, 20.0, *keys)
    height = trajectory.positions[:, trajectory.block_ids.index(balloon), 2].astype(float)
    sag = structure_of(machine).masses.sum() / altitude.stiffness
    target = height[0] + 4.0 * altitude.rate
    assert height[8 * 25 : 9 * 25].mean() == pytest.approx(target - sag, abs=0.1)
    assert height[-50:].mean() == pytest.approx(target - altitude.rate - sag, abs=0.1)
    assert np.ptp(height[-50:]) < 0.05, "it comes to rest"


def test_a_balloon_does_not_lift_more_than_it_can(engine) -> None:
    machine, _ = _aloft(18)
    assert structure_of(machine).masses.sum() > WORKSHOP["Sqr Balloon"].altitude.most
    trajectory = _stood(machine, engine, 6.0, press("UpArrow", 0.5, 5.0))
    assert np.ptp(trajectory.positions[:, 0, 2]) < 0.2


def _hung(springs: int, *, bind: bool = False) -> tuple[Machine, str]:
    """A load that springs hold below an arm, built at their length at rest."""
    draft = KeyedDraft(modules="workshop")
    top = draft.row(_foot(draft), UP, 8)[-1]
    tip = draft.row(top, EAST, 3)[-1]
    load = draft.attach(tip, DOWN)
    for _ in range(4):
        draft.do("shift_block", block_id=load, shift_real=[0.0, 0.0, -0.5])
    draft.row(load, DOWN, 3)
    for _ in range(springs):
        draft.connect(tip, load, DOWN, UP, connector="Spring")
        if bind:
            draft.bind(list(draft.machine.connectors)[-1], "contract", "UpArrow")
    return draft.machine, load


def _springs_stretch(trajectory: Trajectory, load: str) -> np.ndarray:
    index = trajectory.block_ids.index(load)
    tip, height = trajectory.positions[:, [index - 1, index], 2].astype(float).T
    drop = tip - height
    return drop - drop[0]


def _mass_of(machine: Machine, load: str) -> float:
    ids = list(machine.blocks)
    return float(structure_of(machine).masses[ids.index(load) :].sum())


def test_a_load_swings_on_a_spring_as_mass_and_stiffness_say(engine) -> None:
    machine, load = _hung(1)
    spring, mass = WORKSHOP["Spring"].spring, _mass_of(machine, load)
    stretch = _springs_stretch(_stood(machine, engine, 4.0), load)
    period = 2 * math.pi * math.sqrt(mass / (spring.stiffness * GRAVITY))
    over = stretch - mass / spring.stiffness
    rises = np.flatnonzero((over[:-1] < 0.0) & (over[1:] >= 0.0))
    crossings = rises - over[rises] / (over[rises + 1] - over[rises])
    assert len(crossings) > 5
    assert np.diff(crossings[:6]).mean() / 25.0 == pytest.approx(period, rel=0.02)
    # What is lost in a swing: the spring's damping and the air's.
    rate = (spring.damping * GRAVITY / mass + 0.2) / 2
    peaks = [over[a : a + 12].max() for a in rises[:4]]
    assert peaks[3] / peaks[0] == pytest.approx(math.exp(-rate * 3 * period), rel=0.1)


@pytest.mark.ci
def test_springs_between_the_same_faces_are_worth_one(engine) -> None:
    single, load = _hung(1)
    double, other = _hung(2)
    found = [
        _springs_stretch(_stood(machine, engine, 6.0), which)[-25:].mean()
        / _mass_of(machine, which)
        for machine, which in ((single, load), (double, other))
    ]
    assert found[1] == pytest.approx(found[0], rel=0.03)


def test_a_spring_draws_together_while_its_key_is_held(engine) -> None:
    machine, load = _hung(1, bind=True)
    spring, mass = WORKSHOP["Spring"].spring, _mass_of(machine, load)
    built = structure_of(machine).ropes.length[0]
    trajectory = _stood(machine, engine, 15.0, press("UpArrow", 1.0, 7.0))
    stretch = _springs_stretch(trajectory, load)
    sag = mass / spring.stiffness
    drawn = built * (1.0 - spring.shortest)
    assert stretch[7 * 25 : 8 * 25].mean() == pytest.approx(sag - drawn, abs=0.05)
    assert stretch[-25:].mean() == pytest.approx(sag, abs=0.02)
    assert not trajectory.breaks


def test_a_balloon_belongs_to_its_machine_until_its_rope_gives_way(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    balloon = draft.attach(_foot(draft), UP, "Balloon")
    trajectory = _stood(draft.machine, engine, 1.0)
    assert joined_to_start(draft.machine, trajectory).all()
    torn = Break(time_s=0.5, joint=f"1-{balloon}", kind="rope", ratio=1.1, cargo_mass=None)
    later = joined_to_start(draft.machine, replace(trajectory, breaks=(torn,)))
    index = trajectory.block_ids.index(balloon)
    assert later[:12].all()
    assert not later[13:, index].any()
    assert np.delete(later, index, axis=1).all()
