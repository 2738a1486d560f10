"""Films: gates, marks and lines where scorers look for them, and flights round a planet."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image
from support.machines.building import built

from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.line import Line
from buildarena_simulation.render.film import write_film
from buildarena_simulation.render.planet import Flight
from buildarena_simulation.render.scene import Scene
from buildarena_simulation.scenario import Gate, Mark


def lines(scenario: Scenario) -> list[np.ndarray]:
    machine = Machine()
    assert machine.act("start").ok
    picture = Scene(machine, scenario, simulate(machine, scenario, "mujoco")).at(0)
    return [ends for ends, _ in picture.lines]


@pytest.mark.parametrize(
    ("heading_deg", "posts"),
    [(0, [(2.5, 10), (5.5, 10)]), (90, [(4, 11.5), (4, 8.5)]), (180, [(5.5, 10), (2.5, 10)])],
)
def test_a_gates_posts_stand_across_the_way_it_is_crossed(heading_deg, posts) -> None:
    gate = Gate(name="g", center=(4, 10), half_width=1.5, heading_deg=heading_deg)
    west, east, between = lines(Scenario(duration_s=0.2, gates=(gate,)))
    for post, (x, y) in zip((west, east), posts, strict=True):
        assert post == pytest.approx(np.array([[x, y, 0], [x, y, 2]]))
    assert between == pytest.approx(np.array([[*posts[0], 0], [*posts[1], 0]]))


def test_a_mark_is_a_circle_of_its_radius() -> None:
    mark = Mark(name="goal", center=(4, 3, 1), radius=2)
    rim = np.array(lines(Scenario(duration_s=0.2, marks=(mark,))))
    apart = np.linalg.norm(rim - np.array([4, 3, 1]), axis=2)
    assert apart == pytest.approx(np.full(apart.shape, 2.0))
    assert np.ptp(rim[..., 2]) == 0


def test_a_lines_edges_lie_beside_it() -> None:
    line = Line(radius=11, bends=((0.1, -0.12), (0.04, 0.03)), side=-1, half_width=0.4)
    edges = np.array(lines(Scenario(duration_s=0.2, line=line))).reshape(-1, 3)
    assert (edges[:, 2] == 0).all()
    ways, apart = line.nearest(edges)
    assert apart == pytest.approx(np.full(len(edges), 0.4), abs=0.03)
    assert np.ptp(ways) > 0.95 * line.length


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


def test_a_film_has_the_map(around, tmp_path) -> None:
    write_film(built(), SCENARIO, around, tmp_path / "flight.png")
    with Image.open(tmp_path / "flight.png") as sheet:
        frames = [sheet.crop((x, y, x + 640, y + 420)) for y in (0, 420) for x in (0, 640, 1280)]
    path = (194, 65, 12)
    drawn = [sum(count for count, color in f.getcolors(1 << 20) if color == path) for f in frames]
    assert drawn[0] == 0
    assert all(b > a for a, b in pairwise(drawn))
