"""Decouplers as worked out by hand, on both engines."""

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft

from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.modules.sets import module_set
from buildarena_simulation import Scenario, Trajectory, read_trajectory, simulate, write_trajectory
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control, ReleasedPlacement
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, UP, WEST

WORKSHOP = module_set("workshop")
IMPULSE = WORKSHOP["Decoupler"].decouple.impulse
PRESSED = (KeyPress(time_s=0.4, key="UpArrow", hold_for_s=0.1),)


def _staged(below: int, above: int, *, across: bool = False) -> tuple[Machine, list[str]]:
    """A row with a decoupler in it, and the blocks that leave with it."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    draft.row(start, WEST if across else DOWN, below)
    way = EAST if across else UP
    decoupler = draft.attach(start, way, "Decoupler")
    draft.bind(decoupler, "decouple", "UpArrow")
    return draft.machine, [decoupler, *draft.row(decoupler, way, above)]


def _fallen(machine: Machine, engine: str, *, pressed: bool = True) -> Trajectory:
    place = ReleasedPlacement(height=100.0, velocity=(0.0, 0.0, 0.0))
    scenario = Scenario(duration_s=1.0, placement=place, control=Control(mode="agent"))
    return simulate(machine, scenario, engine, controls=PRESSED if pressed else ())


@pytest.mark.nightly(keep=5)
@pytest.mark.parametrize(("below", "above"), [(1, 1), (6, 2), (2, 9)])
@pytest.mark.parametrize("across", [False, True])
def test_both_sides_leave_with_the_same_momentum(engine, below, above, across) -> None:
    machine, leaving = _staged(below, above, across=across)
    trajectory = _fallen(machine, engine)
    structure = structure_of(machine)
    gone = np.isin(structure.block_ids, leaving)
    axis = 0 if across else 2
    velocity = np.diff(trajectory.positions[:, :, axis].astype(float), axis=0)[13] * 25.0
    # What both would have had: free fall with the drag of the mean.
    alone = _fallen(machine, engine, pressed=False)
    common = np.diff(alone.positions[:, :, axis].astype(float), axis=0)[13] * 25.0
    gained = velocity - common
    masses = structure.masses
    assert masses[gone] @ gained[gone] == pytest.approx(IMPULSE, rel=0.05)
    assert masses[~gone] @ gained[~gone] == pytest.approx(-IMPULSE, rel=0.05)
    assert masses @ gained == pytest.approx(0.0, abs=0.02 * IMPULSE)


def test_what_lets_go_is_told_and_is_no_break(engine) -> None:
    machine, leaving = _staged(1, 1)
    trajectory = _fallen(machine, engine)
    assert trajectory.breaks == ()
    (event,) = trajectory.events
    assert (event.what, event.joint, event.held) == ("decoupled", f"1-{leaving[0]}", "")
    assert event.time_s == pytest.approx(0.4, abs=0.021)
    pieces = trajectory.pieces
    assert (pieces[5] == 0).all()
    gone = np.isin(trajectory.block_ids, leaving)
    assert (pieces[-1][gone] == pieces[-1][gone][0]).all()
    assert not (pieces[-1][gone] == pieces[-1, 0]).any()
    again = read_trajectory(write_trajectory(trajectory))
    assert again.events == trajectory.events
    assert write_trajectory(_fallen(machine, engine)) == write_trajectory(trajectory)


def test_without_its_key_it_holds(engine) -> None:
    machine, _ = _staged(1, 1)
    trajectory = _fallen(machine, engine, pressed=False)
    assert trajectory.events == ()
    assert (trajectory.pieces == 0).all()


def test_one_that_is_braced_across_lets_go_and_stays(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    decoupler = draft.attach(start, UP, "Decoupler")
    top = draft.attach(decoupler, UP)
    draft.bind(decoupler, "decouple", "UpArrow")
    draft.connect(start, top, EAST)
    trajectory = _fallen(draft.machine, engine)
    assert [event.what for event in trajectory.events] == ["decoupled"]
    assert (trajectory.pieces == 0).all()
    speed = np.diff(trajectory.positions[-3:, 0].astype(float), axis=0)[-1] * 25.0
    assert np.abs(speed[:2]).max() < 0.1, "what it pushes against itself moves nothing"
