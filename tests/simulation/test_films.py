"""Films of flights round a planet."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image
from support.machines.building import built

from buildarena_geometry import catalogue_of
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.render.film import write_film
from buildarena_simulation.render.planet import Flight
from buildarena_simulation.render.scene import Scene

RADIUS, HEIGHT = 600.0, 40.0


SCENARIO = Scenario.model_validate({"duration_s": 4, "planet": {"radius": RADIUS}})


@pytest.fixture(scope="module")
def around() -> Trajectory:
    """A block that is carried once round the planet towards the north, its own top upwards."""
    trial = simulate(built(), SCENARIO, "mujoco")
    angle = np.linspace(0, 2 * math.pi, len(trial.time_s))
    away = RADIUS + HEIGHT
    place = np.stack([0 * angle, away * np.sin(angle), away * np.cos(angle) - RADIUS], axis=1)
    turn = np.stack([np.cos(angle / 2), -np.sin(angle / 2), 0 * angle, 0 * angle], axis=1)
    return replace(
        trial,
        positions=place[:, None].astype(np.float32),
        quaternions=turn[:, None].astype(np.float32),
    )


def test_the_ground_rolls_by_as_far_as_it_is_round(around) -> None:
    flight = Flight(around, RADIUS)
    assert flight.height == pytest.approx(HEIGHT, abs=1e-3)
    last = len(around.time_s) - 1
    places = np.array([flight.focus(k) for k in range(last + 1)])
    assert places[:, 2] == pytest.approx(HEIGHT, abs=1e-3)
    assert places[-1, 1] == pytest.approx(2 * math.pi * RADIUS, rel=1e-3)
    assert places[:, 0] == pytest.approx(0, abs=1e-2)


def test_a_film_follows_a_boulder_and_else_the_first_block(around) -> None:
    machine = built(("1", "E", "Boulder"), catalogue=catalogue_of("all"))
    trial = simulate(machine, Scenario(duration_s=0.2), "mujoco")
    scene = Scene(machine, Scenario(duration_s=0.2), trial)
    boulder = list(trial.block_ids).index("2")
    assert scene.focus(3) == pytest.approx(trial.positions[3, boulder], abs=1e-6)
    assert Scene(built(), SCENARIO, around).focus(3) == pytest.approx(around.positions[3, 0])


def test_a_film_has_the_map(around, tmp_path) -> None:
    write_film(built(), SCENARIO, around, tmp_path / "flight.png")
    with Image.open(tmp_path / "flight.png") as sheet:
        frames = [sheet.crop((x, y, x + 640, y + 420)) for y in (0, 420) for x in (0, 640, 1280)]
    path = (194, 65, 12)
    drawn = [sum(count for count, color in f.getcolors(1 << 20) if color == path) for f in frames]
    assert drawn[0] == 0
    assert all(b > a for a, b in pairwise(drawn))
