"""Fans, wings, propellers, bowls and balloons as worked out by hand, on both engines."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.marks import nightly

from buildarena_benchmark.experts.drafting import DOWN, EAST, UP, WEST, Direction
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.modules.sets import module_set
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control, ReleasedPlacement
from buildarena_simulation.structure.own_forces import wings_of

WORKSHOP = module_set("workshop")
DRIVEN = Control(mode="agent")
HELD = (KeyPress(time_s=0.0, key="UpArrow", hold_for_s=100.0),)
Law = Callable[[np.ndarray], np.ndarray]


def _released(
    machine: Machine,
    engine: str,
    *,
    seconds: float,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    height: float = 200.0,
    **world: float,
) -> Trajectory:
    place = ReleasedPlacement(height=height, velocity=tuple(velocity))
    scenario = Scenario(duration_s=seconds, placement=place, control=DRIVEN, **world)
    return simulate(machine, scenario, engine, controls=HELD)


def _path(
    machine: Machine,
    force: Law,
    velocity: Sequence[float],
    seconds: float,
    gravity: float = GRAVITY,
) -> np.ndarray:
    """How far a machine gets that does not turn, under weight, drag and a force, (3,)."""
    structure = structure_of(machine)
    mass = structure.masses.sum()
    drag = (structure.linear_drag * structure.masses).sum()
    v, way, step = np.array(velocity, dtype=float), np.zeros(3), 1e-3
    for _ in range(round(seconds / step)):
        a = (force(v) - drag * v) / mass - np.array([0.0, 0.0, gravity])
        way += step * (v + step * a / 2)
        v = v + step * a
    return way


def _way(trajectory: Trajectory) -> np.ndarray:
    first, *_, last = trajectory.positions[:, 0].astype(float)
    return np.asarray(last - first)


@pytest.mark.parametrize("load", [9, nightly(1), nightly(14)])
def test_a_fan_lifts_and_drops_its_load_as_thrust_and_weight_say(engine, load) -> None:
    """By its drive's strength, whatever the gravity is."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    draft.row(start, DOWN, load)
    fan = draft.attach(start, UP, "Flying Block")
    draft.bind(fan, "fly", "UpArrow")
    thrust = 1.3 * WORKSHOP["Flying Block"].push.force * GRAVITY
    trial = _released(draft.machine, engine, seconds=2.0, gravity=40.0, drive_strength=1.3)
    found = _way(trial)
    expected = _path(draft.machine, lambda _: np.array([0.0, 0.0, thrust]), (0, 0, 0), 2.0, 40.0)
    assert found[2] == pytest.approx(expected[2], rel=0.02)
    assert np.abs(found[:2]).max() < 0.01


def _pair(module: str, y_axis: Direction) -> Machine:
    """The same on both sides, so that nothing turns."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for side in (EAST, WEST):
        draft.placed(start, side, module, y_axis)
    return draft.machine


def _plate(v: np.ndarray) -> np.ndarray:
    """The air's force on two wing panels that lie level."""
    wing = WORKSHOP["Wing Panel"].wing
    size = -2 * wing.coefficient * v[2] * min(v @ v, wing.cap_speed**2)
    return np.array([0.0, 0.0, size])


@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize("attack_deg", [-8.0, 2.0, 5.0, 12.0, 30.0, 90.0])
@pytest.mark.parametrize("speed", [12.0, 24.0, 45.0])
def test_a_wing_lifts_and_drags_as_its_law_says(engine, attack_deg, speed) -> None:
    machine = _pair("Wing Panel", UP)
    angle = math.radians(attack_deg)
    velocity = (0.0, speed * math.cos(angle), -speed * math.sin(angle))
    found = _way(_released(machine, engine, seconds=0.6, velocity=velocity))
    expected = _path(machine, _plate, velocity, 0.6)
    assert found == pytest.approx(expected, abs=0.03 * float(np.linalg.norm(expected)))


def test_the_published_law_holds_for_any_flow() -> None:
    velocity = 20.0 * np.random.default_rng(7).normal(size=(200, 3))
    # The law's frame is left-handed: its x axis is ours reversed.
    mirrored = velocity * np.array([-1.0, 1.0, 1.0])
    for name, pitch_deg in {"Propeller": 23.069, "Small Propeller": 22.845}.items():
        pitch = math.radians(pitch_deg)
        along = mirrored @ np.array([-math.sin(pitch), math.cos(pitch), 0.0])
        expected = -0.015 * along * np.minimum((velocity**2).sum(axis=1), 900.0)
        wings = wings_of([WORKSHOP[name].wing] * 200, np.tile(np.eye(3), (200, 1, 1)))
        found = wings.forces(velocity, np.zeros(200, dtype=bool))
        assert found[:, 1] == pytest.approx(expected)
        assert (found[:, [0, 2]] == 0.0).all()


def test_still_air_gives_what_is_fixed_no_energy() -> None:
    velocity = 20.0 * np.random.default_rng(11).normal(size=(500, 3))
    for name in ("Propeller", "Small Propeller", "Wing Panel", "Drag Block"):
        wing = WORKSHOP[name].wing
        wings = wings_of([wing] * 500, np.tile(np.eye(3), (500, 1, 1)))
        free, fixed = (wings.forces(velocity, np.full(500, held)) for held in (False, True))
        power = (free * velocity).sum(axis=1)
        assert (fixed * velocity).sum(axis=1) == pytest.approx(np.minimum(power, 0.0), abs=1e-6)
        unchanged = power <= 0.0
        assert np.array_equal(fixed[unchanged], free[unchanged])
        across = free - power[:, None] * velocity / (velocity**2).sum(axis=1)[:, None]
        assert fixed[~unchanged] == pytest.approx(across[~unchanged])
        assert unchanged.all() == (not wing.pitch_deg)


@pytest.mark.parametrize("y_axis", [UP, DOWN])
def test_bowls_fall_as_fast_as_their_drag_says(engine, y_axis) -> None:
    machine = _pair("Drag Block", y_axis)
    wing = WORKSHOP["Drag Block"].wing
    # The bowl opens against its y axis: what falls with it down is braked.
    coefficient = 2 * wing.coefficient if y_axis == UP else 0.0
    structure = structure_of(machine)
    mass = structure.masses.sum()
    drag = (structure.linear_drag * structure.masses).sum()
    trajectory = _released(machine, engine, seconds=3.0)
    speed = -float(np.diff(trajectory.positions[-2:, 0, 2].astype(float))[0]) * 25.0

    def braked(v: np.ndarray) -> np.ndarray:
        return np.array([0.0, 0.0, coefficient * v[2] ** 2])

    assert -_way(trajectory)[2] == pytest.approx(
        -_path(machine, braked, (0, 0, 0), 3.0)[2], rel=0.02
    )
    if coefficient:
        terminal = (math.sqrt(drag**2 + 4 * coefficient * mass * GRAVITY) - drag) / (
            2 * coefficient
        )
        assert speed == pytest.approx(terminal, rel=0.02)
