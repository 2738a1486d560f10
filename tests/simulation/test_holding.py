"""What grabbers hold and how much, and what decouplers let go."""

import numpy as np
import pytest
from support.machines.building import KeyedDraft, attach
from support.machines.trials import press

from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.modules.sets import module_set
from buildarena_simulation import Scenario, Trajectory, read_trajectory, simulate, write_trajectory
from buildarena_simulation.constants import COLLISION_MARGIN, GRAVITY, JOINT_STRENGTH
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Cargo, Control, ReleasedPlacement, TerrainBox

WORKSHOP = module_set("workshop")


GRIP = WORKSHOP["Grabber"].grip


DRIVEN = Control(mode="agent")


END = 3.0 - COLLISION_MARGIN
"""Height of the grabber's end, units."""


def _stool(*, bound: bool = True) -> tuple[Machine, str]:
    """Four legs, between which a grabber looks down from the starting block."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for side in (EAST, WEST, NORTH, SOUTH):
        draft.row(draft.row(start, side, 2)[-1], DOWN, 4)
    grabber = draft.attach(start, DOWN, "Grabber")
    if bound:
        draft.bind(grabber, "grab", "UpArrow")
        draft.bind(grabber, "release", "DownArrow")
    return draft.machine, grabber


def _cargo(mass: float, *, gap: float = 0.1, final: float | None = None) -> Cargo:
    """Cargo in the air, so far below the grabber's end."""
    return Cargo(
        size=(1.0, 1.0, 1.0),
        initial_mass=mass,
        final_mass=mass if final is None else final,
        ramp_s=8.0,
        at=(0.0, 0.0, END - 1.0 - gap),
    )


def _tried(
    machine: Machine, engine: str, cargo: Cargo, *keys: KeyPress, seconds: float = 3.0
) -> Trajectory:
    scenario = Scenario(duration_s=seconds, cargo=cargo, control=DRIVEN)
    return simulate(machine, scenario, engine, controls=keys)


def _told(trajectory: Trajectory) -> list[tuple[str, str]]:
    return [(event.what, event.held) for event in trajectory.events]


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("mass", [2.0, 50.0, 150.0])
def test_a_grabber_holds_a_load_against_its_weight(engine, mass) -> None:
    machine, grabber = _stool(bound=False)
    trajectory = _tried(machine, engine, _cargo(mass))
    assert _told(trajectory) == [("grabbed", "cargo")]
    assert trajectory.events[0].joint == grabber
    assert np.ptp(trajectory.cargo_position[:, 2]) < 0.06
    joint = [peak.joint for peak in trajectory.joint_peaks].index(f"1-{grabber}")
    borne = trajectory.joint_loads[-25:, joint].mean() * JOINT_STRENGTH["attachment"].force
    assert borne == pytest.approx(mass + WORKSHOP["Grabber"].mass, rel=0.03, abs=1.2)
    weight = structure_of(machine).masses.sum() + mass
    assert trajectory.bearing.ground[-25:].mean() == pytest.approx(weight, rel=0.03)


def test_a_load_that_grows_too_heavy_slips(engine) -> None:
    machine, _ = _stool()
    trajectory = _tried(machine, engine, _cargo(5.0, final=405.0), seconds=6.0)
    assert _told(trajectory) == [("grabbed", "cargo"), ("slipped", "cargo")]
    mass = 5.0 + 400.0 * (trajectory.events[1].time_s - 0.5) / 8.0
    assert mass == pytest.approx(GRIP.force, rel=0.07)
    assert trajectory.cargo_position[-1, 2] == pytest.approx(0.5, abs=0.1)


def test_what_is_out_of_reach_is_not_held(engine) -> None:
    machine, _ = _stool()
    trajectory = _tried(machine, engine, _cargo(2.0, gap=GRIP.reach + 0.1))
    assert trajectory.events == ()
    assert trajectory.cargo_position[-1, 2] == pytest.approx(0.5, abs=0.05)


def test_a_released_grabber_stays_open_until_it_is_told_to_grab(engine) -> None:
    machine, _ = _stool()
    top = END - 1.0 - 0.15
    table = TerrainBox(center=(0.0, 0.0, top / 2), size=(1.0, 1.0, top))
    scenario = Scenario(
        duration_s=4.0, terrain=(table,), cargo=_cargo(2.0, gap=0.1), control=DRIVEN
    )
    keys = (press("DownArrow", 1.0), press("UpArrow", 3.0))
    trajectory = simulate(machine, scenario, engine, controls=keys)
    assert _told(trajectory) == [("grabbed", "cargo"), ("released", "cargo"), ("grabbed", "cargo")]
    times = [event.time_s for event in trajectory.events]
    assert times == pytest.approx([0.0, 1.0, 3.0], abs=0.05)
    assert trajectory.cargo_position[70, 2] == pytest.approx(top + 0.5, abs=0.03)


def _anchored() -> Machine:
    """Fans that would lift it, and a grabber on the ground."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for side in (EAST, WEST):
        block = draft.attach(start, side)
        draft.bind(draft.attach(block, UP, "Flying Block"), "fly", "UpArrow")
    draft.bind(draft.attach(start, DOWN, "Grabber"), "release", "DownArrow")
    return draft.machine


def test_a_grabber_holds_the_ground(engine) -> None:
    machine = _anchored()
    scenario = Scenario(duration_s=2.0, control=DRIVEN)
    keys = (press("UpArrow", 0.2, 2.0), press("DownArrow", 1.2))
    trajectory = simulate(machine, scenario, engine, controls=keys)
    assert _told(trajectory) == [("grabbed", "ground"), ("released", "ground")]
    height = trajectory.positions[:, 0, 2].astype(float)
    assert np.ptp(height[:30]) < 0.05
    lift = 2 * WORKSHOP["Flying Block"].push.force
    mass = structure_of(machine).masses.sum()
    rise = 0.5 * (lift / mass - 1.0) * GRAVITY * 0.6**2
    assert height[45] - height[30] == pytest.approx(rise, rel=0.15)


def test_a_grabber_holds_a_block_of_another_piece(engine) -> None:
    machine, grabber = _stool()
    assert attach(machine, grabber, "A").ok
    loose = list(machine.blocks)[-1]
    for _ in range(2):
        away = {"block_id": loose, "shift_real": [0.3, 0.0, 0.0]}
        assert machine.act("shift_block", away).ok
    scenario = Scenario(duration_s=2.0, control=DRIVEN)
    trajectory = simulate(machine, scenario, engine, controls=(press("DownArrow", 1.0),))
    assert _told(trajectory) == [("grabbed", loose), ("released", loose)]
    height = trajectory.positions[:, trajectory.block_ids.index(loose), 2].astype(float)
    assert np.ptp(height[2:25]) < 0.06
    assert height[-1] == pytest.approx(0.5, abs=0.1)


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


@pytest.mark.parametrize(("below", "above", "across"), [(6, 2, False), (2, 9, True)])
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
