"""Pads grip where wood slides, on both engines."""

import math

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft

from buildarena_geometry.modules.sets import module_set
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.scenario import SpanPlacement, TerrainBox
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, WEST

PAD = module_set("workshop")["Grip Pad"]


def _slid(engine: str, slope_deg: float, *, pads: bool) -> np.ndarray:
    """Way down a slope of a sled, with or without pads below it."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    for side in (EAST, WEST, NORTH, SOUTH):
        block = draft.attach(start, side)
        if pads:
            draft.attach(block, DOWN, "Grip Pad")
    slope = math.radians(slope_deg)
    lowest = 40.0 + 1.0 / math.cos(slope) + 1.5 * math.tan(slope) + 1.1
    terrain = TerrainBox(center=(0.0, 0.0, 40.0), size=(20.0, 400.0, 2.0), slope_deg=slope_deg)
    place = SpanPlacement(gap=1.0, lowest_center=lowest)
    scenario = Scenario(duration_s=3.0, terrain=(terrain,), placement=place)
    positions = simulate(draft.machine, scenario, engine).positions[:, 0].astype(float)
    return positions @ np.array([0.0, -math.cos(slope), -math.sin(slope)])


def test_pads_hold_on_a_slope_that_wood_slides_down(engine) -> None:
    wood, pads = (_slid(engine, 45.0, pads=with_pads) for with_pads in (False, True))
    assert wood[-1] - wood[25] > 5.0
    assert abs(pads[-1] - pads[25]) < 0.3


def test_pads_slide_as_their_friction_says(engine) -> None:
    slope = math.radians(58.0)
    way = _slid(engine, 58.0, pads=True)
    speeds = np.diff(way) * 25.0
    gained = np.polyfit(np.arange(30) / 25.0, speeds[35:65], 1)[0]
    # Of start and four blocks, with drag, and four pads, without.
    drag = 0.2 * 1.45 / 3.45 * float(speeds[35:65].mean())
    grip = PAD.physics.friction * GRAVITY * math.cos(slope)
    expected = GRAVITY * math.sin(slope) - grip - drag
    assert gained == pytest.approx(expected, abs=0.03 * grip)
