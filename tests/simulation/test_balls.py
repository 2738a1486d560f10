"""A ball as cargo: it rolls as closed forms say, and looks round."""

import math

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.piloted import FASTER_FIRST

from buildarena_simulation import Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.parquet import read_trajectory, write_trajectory

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


def test_a_trajectory_knows_that_its_cargo_is_a_ball() -> None:
    draft = KeyedDraft()
    draft.start()
    trial = simulate(draft.machine, on_a_slope(), "mujoco")
    assert read_trajectory(write_trajectory(trial)).cargo_shape == "ball"


def test_a_ball_has_one_diameter() -> None:
    with pytest.raises(ValueError, match="a ball's size is its diameter three times"):
        Scenario.model_validate({"duration_s": 1, "cargo": BALL | {"size": [1, 1, 2]}})
