"""Modules whose body is a sphere, on both engines."""

from pathlib import Path

import numpy as np
import pytest
from support.machines.building import BLOCK, built
from support.machines.module_files import like, module_file

from buildarena_geometry import Machine, load_catalogue
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.engines.base import rotation_of
from buildarena_simulation.machine import structure_of

RADIUS = 0.8


@pytest.fixture
def on_a_ball(tmp_path: Path) -> Machine:
    """A starting block on top of a ball that hangs from its lower face."""
    ball = like(BLOCK, "Ball", faces=[], mass=2.0, grabs=False)
    ball["body"] = [{"shape": "sphere", "radius": RADIUS, "center": [0, 0, 0.9]}]
    ball["physics"]["mass_at"] = "body"
    catalogue = load_catalogue(module_file(tmp_path, ball))
    return built(("1", "D", "Ball"), catalogue=catalogue, init_rotation=[0, 0, 40])


def test_a_ball_has_a_balls_volume_and_inertia(on_a_ball) -> None:
    structure = structure_of(on_a_ball)
    shape = structure.parts[1].shapes[0]
    assert shape.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3)
    np.testing.assert_allclose(shape.reach(), RADIUS)
    np.testing.assert_allclose(
        structure.inertias[1], 2 / 5 * 2.0 * RADIUS**2 * np.eye(3), atol=1e-12
    )


def test_a_ball_touches_the_ground_at_its_radius(on_a_ball, engine) -> None:
    # Tilted by 40°, a box of the same extent would stand a third higher, or be pushed up there.
    trajectory = simulate(on_a_ball, Scenario(duration_s=0.2), engine=engine, seed=0)
    away = rotation_of(trajectory.quaternions[-1, 1].astype(float))[:, 2]
    middle = trajectory.positions[-1, 1] + 0.4 * away
    assert middle[2] == pytest.approx(RADIUS, abs=0.03)
