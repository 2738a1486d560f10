"""A line on the ground: where it is, and what sensors over it tell."""

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft

from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_simulation.line import Line
from buildarena_simulation.offered import Senses
from buildarena_simulation.scenario import Control, Scenario
from buildarena_worker.builtin.designs.drafting import EAST, NORTH

BENT = Line(radius=11, bends=((0.1, -0.12), (0.04, 0.03)))
IDLE = "function control() return {} end"


def told(line: Line, *, north: float = 0.0, delay_ticks: int = 0) -> dict[str, list[float]]:
    """What the ground sensors of a block that stands at (0, 0) tell."""
    machine = Machine()
    assert machine.act("start").ok
    scenario = Scenario(
        duration_s=0.2,
        line=line.model_copy(update={"ahead": north}),
        control=Control(mode="agent"),
        senses=Senses(offers=("line",), delay_ticks=delay_ticks),
    )
    piloting = simulate(machine.with_controller(IDLE), scenario, "mujoco").piloting
    assert piloting is not None
    return {name: piloting.senses[:, k].tolist() for k, name in enumerate(piloting.sense_names)}


def test_a_line_begins_at_the_origin_towards_the_north() -> None:
    points = BENT.points(1000)
    assert points[0] == pytest.approx([0, 0])
    assert points[1][1] > 0
    assert abs(points[1][0]) < 0.01 * points[1][1]
    assert points[500][0] < -15
    mirrored = BENT.model_copy(update={"side": -1.0})
    assert mirrored.points(1000) == pytest.approx(points * [-1, 1])


def test_its_points_are_evenly_apart_and_all_of_its_length() -> None:
    points = BENT.points(2000)
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    assert steps == pytest.approx(np.full(2000, BENT.length / 2000), rel=1e-3)


def test_a_circle_has_the_figures_of_a_circle() -> None:
    circle = Line(radius=12)
    assert circle.length == pytest.approx(2 * np.pi * 12, rel=1e-6)
    assert circle.greatest_curvature == pytest.approx(1 / 12, rel=1e-6)


def test_curvature_is_what_three_points_of_it_show() -> None:
    points = BENT.points(400)
    before, after = np.roll(points, 1, axis=0) - points, np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    shown = 2 * np.abs(cross) / (lengths[0] * lengths[1] * np.linalg.norm(before - after, axis=1))
    assert shown.max() == pytest.approx(BENT.greatest_curvature, rel=0.02)


@pytest.mark.parametrize("aside", [-0.8, 0.0, 0.8])
def test_the_nearest_point_of_a_place_is_found(aside) -> None:
    points = BENT.points(360)
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    right = np.column_stack([ahead[:, 1], -ahead[:, 0]]) / np.linalg.norm(ahead, axis=1)[:, None]
    ways, apart = BENT.nearest(points + aside * right)
    assert apart == pytest.approx(np.full(360, abs(aside)), abs=0.01)
    missing = ways - np.arange(360) * BENT.length / 360
    missing -= BENT.length * np.round(missing / BENT.length)
    assert np.abs(missing).max() < 0.05


def test_sensors_tell_whether_the_line_is_below_them() -> None:
    line = Line(radius=12, half_width=0.5, apart=0.6)
    assert told(line)["line.middle"][0] == 1
    assert told(line)["line.left"][0] == told(line)["line.right"][0] == 0
    wide = told(line.model_copy(update={"half_width": 0.7}))
    assert [wide[f"line.{sensor}"][0] for sensor in ("left", "middle", "right")] == [1, 1, 1]
    # After three units a circle of 12 has bent by 0.38 to the left, and to the right its mirror.
    left = told(line, north=3.0)
    assert [left[f"line.{sensor}"][0] for sensor in ("left", "middle", "right")] == [1, 1, 0]
    right = told(line.model_copy(update={"side": -1.0}), north=3.0)
    assert [right[f"line.{sensor}"][0] for sensor in ("left", "middle", "right")] == [0, 1, 1]
    far = told(line, north=8.0)
    assert [far[f"line.{sensor}"][0] for sensor in ("left", "middle", "right")] == [0, 0, 0]


def test_sensors_turn_with_the_block_they_sit_on(engine) -> None:
    """A car that turns on the spot sees the line ahead, then no more, and again behind it."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    wheels = [draft.wheel(draft.row(start, way, 1)[-1], way) for way in (EAST, (-1, 0, 0))]
    draft.attach(start, NORTH)
    program = f"""
    function control()
      return {{ ["{wheels[0]}.spinning_forward"] = -0.3, ["{wheels[1]}.spinning_forward"] = 0.3 }}
    end"""
    scenario = Scenario(
        duration_s=6,
        line=Line(radius=30),
        control=Control(mode="agent"),
        senses=Senses(offers=("axes", "line")),
    )
    trial = simulate(draft.machine.with_controller(program), scenario, engine)
    names = trial.piloting.sense_names
    forward = trial.piloting.senses[:, names.index("forward.y")]
    middle = trial.piloting.senses[:, names.index("line.middle")]
    valid = ~np.isnan(forward)
    assert middle[valid & (forward > 0.98)].all()
    assert not middle[valid & (np.abs(forward) < 0.1)].any()


def test_who_is_not_offered_the_line_does_not_sense_it() -> None:
    assert "line" not in Senses().offers
    scenario = Scenario(
        duration_s=0.2, line=BENT, control=Control(mode="agent"), senses=Senses(offers=("wheels",))
    )
    machine = Machine()
    assert machine.act("start").ok
    trial = simulate(machine.with_controller(IDLE), scenario, "mujoco")
    assert not any(name.startswith("line") for name in trial.piloting.sense_names)
