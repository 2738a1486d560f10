"""Balls that roll and boulders that are thrown against closed forms, and pads that grip."""

import math
from functools import cache

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.machines.piloted import FASTER_FIRST

from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, WEST
from buildarena_geometry import module_set
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.scenario import SpanPlacement, TerrainBox

SLOPE_DEG = 15


BALL = {"shape": "ball", "size": [2, 2, 2], "initial_mass": 8, "final_mass": 8, "ramp_s": 1}


def on_a_slope() -> Scenario:
    """A ball of radius 1 just above a slope that falls to the south."""
    slope = math.radians(SLOPE_DEG)
    underside = 5 + 4 * math.sin(slope) + 1.5 / math.cos(slope) - 1
    return Scenario.model_validate(
        {
            "duration_s": 1,
            "terrain": [{"center": [20, 0, 5], "size": [10, 30, 1], "slope_deg": SLOPE_DEG}],
            "cargo": BALL | {"at": [20, 4 * math.cos(slope), underside]},
        }
    )


@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_ball_rolls_down_a_slope(engine) -> None:
    """It gains 5/7 g sin, and turns as far as it rolls: 3 %."""
    draft = KeyedDraft()
    draft.start()
    trial = simulate(draft.machine, on_a_slope(), engine)
    path = trial.cargo_position.astype(float)
    way = np.linalg.norm(path - path[0], axis=1)
    speed = np.gradient(way, trial.time_s)
    gained = (speed[-2] - speed[6]) / (trial.time_s[-2] - trial.time_s[6])
    assert gained == pytest.approx(5 / 7 * GRAVITY * math.sin(math.radians(SLOPE_DEG)), rel=0.03)
    turned = 2 * np.arccos(np.clip(np.abs(trial.cargo_quaternion[:, 0].astype(float)), 0, 1))
    assert turned[12] == pytest.approx(way[12] / 1.0, rel=0.05)


def test_a_ball_has_one_diameter() -> None:
    with pytest.raises(ValueError, match="a ball's size is its diameter three times"):
        Scenario.model_validate({"duration_s": 1, "cargo": BALL | {"size": [1, 1, 2]}})


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


PAD = module_set("workshop")["Grip Pad"]


def _slid(engine: str, slope_deg: float) -> np.ndarray:
    """Way down a slope of a sled with pads below it."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for side in (EAST, WEST, NORTH, SOUTH):
        draft.attach(draft.attach(start, side), DOWN, "Grip Pad")
    slope = math.radians(slope_deg)
    lowest = 40.0 + 1.0 / math.cos(slope) + 1.5 * math.tan(slope) + 1.1
    terrain = TerrainBox(center=(0.0, 0.0, 40.0), size=(20.0, 400.0, 2.0), slope_deg=slope_deg)
    place = SpanPlacement(gap=1.0, lowest_center=lowest)
    scenario = Scenario(duration_s=3.0, terrain=(terrain,), placement=place)
    positions = simulate(draft.machine, scenario, engine).positions[:, 0].astype(float)
    return positions @ np.array([0.0, -math.cos(slope), -math.sin(slope)])


def test_pads_slide_as_their_friction_says(engine) -> None:
    slope = math.radians(58.0)
    way = _slid(engine, 58.0)
    speeds = np.diff(way) * 25.0
    gained = np.polyfit(np.arange(30) / 25.0, speeds[35:65], 1)[0]
    # Of start and four blocks, with drag, and four pads, without.
    drag = 0.2 * 1.45 / 3.45 * float(speeds[35:65].mean())
    grip = PAD.physics.friction * GRAVITY * math.cos(slope)
    expected = GRAVITY * math.sin(slope) - grip - drag
    assert gained == pytest.approx(expected, abs=0.03 * grip)
    held = _slid(engine, 45.0)
    assert abs(held[-1] - held[25]) < 0.3, "wood slides down there"
