"""Pipes, rings, cylinders and fields of heights as terrain, and a line on the ground."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.building import KeyedDraft
from support.machines.piloted import FASTER_FIRST
from support.marks import nightly

from buildarena_benchmark.experts.drafting import UP
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.line import Line
from buildarena_simulation.scenario import Control
from buildarena_simulation.sensor_config import Senses
from buildarena_simulation.terrain import shape_of

QUARTER = {
    "shape": "pipe",
    "center": [0, 6, 5],
    "radius": 5,
    "length": 6,
    "from_deg": 0,
    "to_deg": 90,
}


RING = {"shape": "pipe", "center": [0, 8, 4], "radius": 3, "length": 1, "heading_deg": 90}


STEPS = {"shape": "heights", "center": [0, 10, 0], "cell": [2, 3], "rows": [[0, 1, 1], [2, 0, 1]]}


HUMP = {"shape": "cylinder", "center": [0, 5, 0], "radius": 2, "length": 8}


def scenario(*terrain, duration_s: float = 2.0, **fields) -> Scenario:
    return Scenario.model_validate({"duration_s": duration_s, "terrain": terrain, **fields})


def distances(*terrain, points: np.ndarray) -> np.ndarray:
    """From points (K, 3) to the nearest box, (K,), units; 0 inside."""
    shapes = [shape_of(box) for box in scenario(*terrain).terrain]
    local = [(points - s.center) @ s.rotation for s in shapes]
    gaps = [np.maximum(np.abs(p) - s.half_extents, 0) for p, s in zip(local, shapes, strict=True)]
    return np.min([np.linalg.norm(gap, axis=1) for gap in gaps], axis=0)


def circle(center, radius: float, angles: np.ndarray, heading_deg: float) -> np.ndarray:
    """Points at angles from straight down towards what is ahead, (K, 3)."""
    heading, turn = math.radians(heading_deg), np.radians(angles)
    ahead = radius * np.sin(turn)
    offsets = [ahead * math.sin(heading), ahead * math.cos(heading), -radius * np.cos(turn)]
    return np.array(center) + np.array(offsets).T


def test_a_pipes_inside_is_a_circle_without_gaps() -> None:
    """Within what a polygon of so many sides strays from its circle; it is free inside."""
    for pipe, from_deg, to_deg in (
        ({**QUARTER, "heading_deg": 30}, 0, 90),
        ({**QUARTER, "from_deg": -90}, -90, 90),
        (RING, -180, 180),
    ):
        angles = np.linspace(from_deg, to_deg, 90)
        center, radius = pipe["center"], pipe["radius"]
        stray = radius / math.cos(math.radians(180 / 12)) - radius
        heading = pipe.get("heading_deg", 0)
        middle = circle(center, radius + 0.25, angles, heading)
        assert distances(pipe, points=middle).max() < 0.01
        inside = distances(pipe, points=circle(center, radius - 0.5, angles, heading))
        assert inside.min() >= 0.5 - 1e-6
        assert inside.max() <= 0.5 + stray + 0.01


def test_a_cone_is_solid_and_narrows() -> None:
    """At each height its radius is that of a cone, within half a step."""
    cone = {
        "shape": "cone",
        "center": [3, 5, 1],
        "radius": 3,
        "height": 2,
        "layers": 8,
        "sides": 16,
    }
    angles = np.linspace(-180, 180, 60)
    for height in (0.1, 0.9, 1.6):
        radius, step = 3 * (1 - height / 2), 3 / 8 / 2
        around = circle((0, 0, 0), 1, angles, 0)[:, [1, 2]]
        for factor, is_solid in ((radius - step, True), (radius + step + 0.1, False)):
            points = np.column_stack([factor * around, np.full(len(angles), height)])
            inside = distances(cone, points=np.add(points, (3, 5, 1))) < 1e-6
            assert set(inside.tolist()) == {is_solid}, (height, factor)


def test_a_bend_is_a_wall_without_gaps() -> None:
    bend = {
        "shape": "bend",
        "center": [7, 15, 0],
        "radius": 10,
        "height": 1.5,
        "from_deg": -90,
        "to_deg": 0,
    }
    turn = np.radians(np.linspace(-90, 0, 60))
    for radius, least, most in ((10.25, 0, 0.01), (9.5, 0.49, 0.5 + 0.06), (11.0, 0.3, 0.51)):
        ring = [7 + radius * np.sin(turn), 15 + radius * np.cos(turn), np.full(60, 0.7)]
        gaps = distances(bend, points=np.array(ring).T)
        assert least <= gaps.min() <= gaps.max() <= most, radius
    with pytest.raises(ValidationError, match="is not an arc"):
        scenario(bend | {"to_deg": -90})


def test_a_field_of_heights_is_a_box_for_each_run_of_cells() -> None:
    boxes = [(box.center, box.size) for box in scenario(STEPS).terrain]
    assert boxes == [
        ((1.0, 8.5, 0.5), (4.0, 3.0, 1.0)),
        ((-2.0, 11.5, 1.0), (2.0, 3.0, 2.0)),
        ((2.0, 11.5, 0.5), (2.0, 3.0, 1.0)),
    ]


def test_what_is_round_is_boxes_from_then_on_and_boxes_stay_as_they_were() -> None:
    wall = {"center": [0, 9, 1], "size": [2, 1, 2]}
    world = scenario(wall, RING)
    assert len(world.terrain) == 13
    assert Scenario.model_validate_json(world.model_dump_json()) == world
    assert scenario(wall).model_dump(mode="json")["terrain"] == [{**wall, "slope_deg": 0.0}]


def fallen(engine: str, *terrain, height: float) -> np.ndarray:
    """Where a block is that is let go above (0, 0), and a boulder on it, (T, 2, 3)."""
    draft = KeyedDraft(modules="all")
    draft.attach(draft.start(), UP, "Boulder")
    placement = {"kind": "released", "height": height}
    return simulate(
        draft.machine, scenario(*terrain, duration_s=3.0, placement=placement), engine
    ).positions.astype(float)


@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("heading_deg", [90, nightly(0)])
def test_what_falls_beside_the_middle_of_a_half_pipe_slides_there(engine, heading_deg) -> None:
    """From where its wall rises by 50 degrees: more than friction holds."""
    aside = 4 * math.sin(math.radians(50))
    center = [-aside, 0, 4.6] if heading_deg else [0, -aside, 4.6]
    half = {**QUARTER, "center": center, "radius": 4, "from_deg": -90, "heading_deg": heading_deg}
    block = fallen(engine, half, height=2.4)[:, 0]
    across = block[:, 0 if heading_deg else 1]
    assert across.min() < -1.5
    apart = np.hypot(across - (-aside), block[:, 2] - 4.6)
    assert apart.max() < 4.2
    along = block[:, 1 if heading_deg else 0]
    assert np.abs(along).max() < 0.5


def test_what_is_round_and_wrong_is_named() -> None:
    for entry, why in (
        ({**RING, "segments": 1}, "1 segments are too few for 360 degrees"),
        ({**QUARTER, "to_deg": -10}, "not beyond from_deg"),
        ({**HUMP, "sides": 5}, "multiple of 2"),
        ({**HUMP, "shape": "wedge"}, "0: Input tag 'wedge'.*'pipe', 'cylinder'"),
        ({**HUMP, "bend": 5}, "0.cylinder.bend"),
        ({**RING, "segments": 64, "radius": -1}, "0.pipe.radius"),
        ({**STEPS, "rows": [[1, 2], [1]]}, "rows have 1 to 2 heights"),
        ({**STEPS, "rows": [[0.05]]}, "0.05 is below 0.1"),
        ({**STEPS, "rows": [[float("nan")]]}, "0.heights.rows"),
        ({**STEPS, "rows": []}, "0.heights.rows"),
        ({**STEPS, "cell": [1, 0]}, "0.heights.cell"),
    ):
        with pytest.raises(ValidationError, match=why):
            scenario(entry)
    with pytest.raises(ValidationError, match="at most 64"):
        scenario({**RING, "segments": 40}, {**RING, "segments": 40})


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


def test_the_nearest_point_of_a_place_is_found() -> None:
    points = BENT.points(360)
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    right = np.column_stack([ahead[:, 1], -ahead[:, 0]]) / np.linalg.norm(ahead, axis=1)[:, None]
    for aside in (-0.8, 0.0, 0.8):
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
