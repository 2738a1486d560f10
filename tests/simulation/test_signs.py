"""Gates and marks stand in films where scorers look for them, and nothing touches them."""

import numpy as np
import pytest

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_simulation.line import Line
from buildarena_simulation.render.scene import Scene
from buildarena_simulation.scenario import Gate, Mark, Scenario


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


def test_the_slaloms_gates_are_all_drawn() -> None:
    scenario = builtin_tasks()["mechanisms-2"].scenario.model_copy(update={"duration_s": 0.2})
    assert len(lines(scenario)) == 3 * len(scenario.gates) == 15


def test_a_lines_edges_lie_beside_it() -> None:
    line = Line(radius=11, bends=((0.1, -0.12), (0.04, 0.03)), side=-1, half_width=0.4)
    edges = np.array(lines(Scenario(duration_s=0.2, line=line))).reshape(-1, 3)
    assert (edges[:, 2] == 0).all()
    ways, apart = line.nearest(edges)
    assert apart == pytest.approx(np.full(len(edges), 0.4), abs=0.03)
    assert np.ptp(ways) > 0.95 * line.length
