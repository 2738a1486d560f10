"""Keys, heat, ropes and the lock between a scenario and its machine."""

import math

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.families import car, rocket
from support.machines.references import REFERENCES, load_machine
from support.machines.trials import press

from buildarena_geometry import KeyPress, Machine, load_catalogue
from buildarena_geometry.flames import heating
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.control import Drives, heated_cannons, key_levels, plan_schedule
from buildarena_simulation.machine import bindings_of, structure_of
from buildarena_simulation.scenario import Control, SpanPlacement
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, UP

MOTOR = load_catalogue()["Powered Wheel"].motor
WHEEL_SPEED, WHEEL_LAG_RATE = MOTOR.speed, MOTOR.lag_per_s


def _speeds(machine: Machine, *keys: KeyPress) -> np.ndarray:
    structure, times = structure_of(machine), 0.01 * np.arange(300)
    return plan_schedule(
        structure,
        key_levels(bindings_of(machine), keys, times),
        Drives(structure, 0.01),
        control=Control(mode="agent"),
        times=times,
    ).targets


def test_a_wheel_follows_its_key_with_a_lag() -> None:
    speeds = np.abs(_speeds(car(), press("UpArrow", 0.5, 1.0))[:, 0])
    assert (speeds[:50] == 0.0).all()
    reached = WHEEL_SPEED * (1 - math.exp(-WHEEL_LAG_RATE * 0.1))
    assert speeds[59] == pytest.approx(reached)
    assert speeds[149] == pytest.approx(WHEEL_SPEED, rel=1e-3)
    assert speeds[299] < 0.01


def test_keys_for_both_directions_brake() -> None:
    both = press("UpArrow", 0.0, 3.0), press("DownArrow", 0.0, 3.0)
    assert (_speeds(car(), *both) == 0.0).all()


def test_wheels_on_both_sides_roll_the_same_way_once_flipped() -> None:
    machine = car()
    structure = structure_of(machine)
    speeds = _speeds(machine, press("UpArrow", 0.0, 3.0))[-1]
    spin = speeds[:, None] * structure.directions[structure.wheels]
    rolling = np.cross(spin, [0.0, 0.0, 1.0])  # velocity of the axle over the ground
    assert (rolling[:, 1] > 10.0).all()


def test_given_controls_replace_the_machines_own(tasks) -> None:
    scenario = tasks["transport-1"].scenario.model_copy(update={"duration_s": 2.0})
    machine = car(drive=())
    keys = (press("UpArrow", 0.0, 2.0), press("Alpha9", 0.0, 1.0))
    trajectory = simulate(machine, scenario, "mujoco", controls=keys)
    assert trajectory.positions[-1, 0, 1] > 10.0
    assert trajectory.settings["effective_key_presses"] == 1


def _heated(flame: tuple[float, float, float]) -> bool:
    """Whether a flame heats a cannon at the origin that sprays down."""
    structure = structure_of(rocket((EAST,)))
    shown = np.zeros((len(structure), 3))
    directions = np.zeros((len(structure), 3))
    directions[structure.cannons] = DOWN
    directions[structure.torches] = UP
    shown[structure.torches] = np.array(flame) - UP
    return bool(heated_cannons(structure, shown, directions)[0])


def test_a_cannon_is_heated_in_the_simulation_if_its_builder_was_told_so() -> None:
    for name in REFERENCES:
        machine = load_machine(name)
        structure = structure_of(machine)
        directions = np.zeros((len(structure), 3))
        for row, part in enumerate(structure.parts):
            if part.direction is not None:
                directions[row] = part.direction
        simulated = heated_cannons(structure, structure.shown, directions)
        ids = [structure.block_ids[row] for row in structure.cannons]
        told = {cannon: bool(torches) for cannon, torches in heating(machine.state).items()}
        assert told == dict(zip(ids, simulated.tolist(), strict=True)), name


def test_a_flame_heats_what_it_touches_and_a_small_one_at_the_waist_misses() -> None:
    waist = -0.125
    for place, heats in {
        (0.0, 0.0, -1.0): True,  # the outlet
        (0.0, 0.0, 0.75): True,  # the inlet
        (0.79, 0.0, -0.5): True,
        (0.81, 0.0, -0.5): False,
        (0.0, 0.0, -1.31): False,
        (0.75, 0.0, waist): False,
        (0.7, 0.0, waist): True,
        (0.75, 0.0, waist - 0.375): True,
    }.items():
        assert _heated(place) == heats, place


def test_a_rope_does_not_push(engine) -> None:
    draft = KeyedDraft()
    low = draft.start()
    middle, high = draft.row(low, UP, 2)
    draft.connect(low, high, UP, DOWN, connector="Winch")
    draft.do("remove_block", block_id=middle)
    scenario = Scenario(duration_s=2.0, placement=SpanPlacement(gap=1.0, lowest_center=0.6))
    trajectory = simulate(draft.machine, scenario, engine)
    # The upper block has come down on the lower one, or beside it.
    assert trajectory.positions[-1, 1, 2] < 2.0
