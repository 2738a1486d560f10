"""Thrown balls against closed forms: free flight with and without drag, and a trebuchet."""

import math
from functools import cache

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.piloted import FASTER_FIRST
from support.machines.rigs import Rig, catalogue, place_of, turned_by

from buildarena_geometry import Catalogue, module_set
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST

SPEED = (0.0, 22.0, 22.0)


@cache
def released(engine: str) -> Trajectory:
    """A starting block and a boulder before it, let go together."""
    draft = KeyedDraft(modules="all")
    draft.attach(draft.start(), NORTH, "Boulder")
    placement = {"kind": "released", "height": 20, "velocity": SPEED}
    return simulate(
        draft.machine, Scenario.model_validate({"duration_s": 1.8, "placement": placement}), engine
    )


@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize(("block", "drag"), [(0, 0.2), (1, 0.0)], ids=["block", "boulder"])
def test_a_free_flight(engine, block, drag) -> None:
    """v' = -drag v - g: with a drag of 0 in a vacuum; within 0.8 % of the way."""
    trial = released(engine)
    time_s = trial.time_s
    lasting = -np.expm1(-drag * time_s) / drag if drag else time_s
    fallen = (time_s - lasting) / drag if drag else time_s**2 / 2
    expected = np.outer(lasting, SPEED) - np.outer(fallen, [0, 0, GRAVITY])
    flown = trial.positions[:, block] - trial.positions[0, block]
    apart = np.linalg.norm(flown - expected, axis=1)
    assert (apart <= 0.02 + 0.008 * np.linalg.norm(expected, axis=1)).all(), apart.max()


@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_boulder_lies_on_its_face_and_nothing_holds_it(engine) -> None:
    """It settles in a cup, where it stays; from a bare side it falls off."""
    draft = KeyedDraft(modules="all")
    base = draft.start()
    bowl = draft.attach(base, UP, "Bomb Holder")
    draft.attach(bowl, UP, "Boulder")
    draft.attach(base, NORTH, "Boulder")
    trial = simulate(draft.machine, Scenario.model_validate({"duration_s": 2}), engine)
    settled = trial.positions[:, 2] - trial.positions[:, 1]
    assert np.abs(settled[-1] - settled[0] - [0, 0, -0.15]).max() < 0.05
    assert trial.positions[-1, 3, 2] == pytest.approx(0.85, abs=0.03)
    assert len({int(piece) for piece in trial.pieces[0]}) == 3


def trebuchet() -> tuple[Rig, str, str, str]:
    """Weights of 40 at a short arm of 2, a boulder in a cup at one of 6: its block, and theirs."""
    modules = {
        **catalogue(),
        **{name: module_set("all")[name] for name in ("Boulder", "Bomb Holder")},
    }
    rig = Rig(Catalogue(tuple(modules.values())))
    hub = rig.attach(rig.attach(rig.row(rig.top, EAST, 2)[-1], EAST, "Swivel"), EAST)
    cup = rig.attach(rig.row(hub, SOUTH, 6)[-1], UP, "Bomb Holder")
    boulder = rig.attach(cup, UP, "Boulder")
    short = rig.row(hub, NORTH, 2)[-1]
    for side in (EAST, WEST):
        weight = rig.attach(rig.attach(short, side, "Weight"), side, "Weight")
    return rig, hub, boulder, weight


@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_trebuchet_beside_the_two_mass_model(engine) -> None:
    """M and m on an arm without mass: (M R² + m r²) w² / 2 grows by M g fall - m g rise.

    From 0.2 rad, when the boulder has settled, to 0.8 rad. It comes out 10 % to 15 % slower than
    that, since the arm and its cup weigh 3. With each block a mass of its own the model is right
    within 5 %: what it lacks is drag.
    """
    rig, hub, boulder, weight = trebuchet()
    trial = rig.tried(engine, 1.6)
    ids, blocks = list(trial.block_ids), rig.machine.blocks
    pivot = place_of(trial, hub)[0]
    angle = turned_by(trial, hub, (-1, 0, 0))
    spin = np.gradient(angle, trial.time_s)
    first, last = int(np.argmax(angle > 0.2)), int(np.argmax(angle > 0.8))

    def model(masses: dict[str, float]) -> float:
        gained = inertia = 0.0
        for name, mass in masses.items():
            path = place_of(trial, name)
            gained += mass * GRAVITY * float(path[first, 2] - path[last, 2])
            inertia += mass * float(((path[last] - pivot)[1:] ** 2).sum())
        return math.sqrt(spin[first] ** 2 + 2 * gained / inertia)

    moving = {name: blocks[name].module.mass for name in ids[ids.index(hub) :]}
    assert 0.95 < spin[last] / model(moving) < 1.01
    assert 0.85 < spin[last] / model({weight: 40, boulder: 5}) < 0.90
    assert np.linalg.norm(place_of(trial, boulder)[last] - place_of(trial, hub)[last]) > 6
