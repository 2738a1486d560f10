"""Check that the level measured by a script is the one of its trial."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from buildarena_besiege.exporting.probes import Probe, level_probes
from buildarena_besiege.logs.log_lines import World
from buildarena_simulation import Scenario

GROUND_TOLERANCE: Final = 0.25
"""Tolerance for uneven ground, units."""

TERRAIN_TOLERANCE: Final = (0.1, 0.2)
"""Tolerance of a terrain's height: units, or a share of it, whichever is more.

Public logs put the tops of the support tasks' boxes at about 4.5 instead of 5.
"""

GRAVITY_TOLERANCE: Final = 0.005
"""Tolerance of gravity, as a share."""


def level_finding(world: World, scenario: Scenario) -> str | None:
    """Return evidence that another level than the trial's is open; None if there is none.

    Args:
        world: Measurements of the script.
        scenario: Scenario with the expected terrain and gravity.
    """
    return next(_findings(world, scenario), None)


def _findings(world: World, scenario: Scenario) -> Iterator[str]:
    expected = -scenario.gravity
    if not abs(world.gravity - expected) <= GRAVITY_TOLERANCE * scenario.gravity:
        yield f"gravity is {world.gravity:.2f}, not {expected:.2f}"
    probes = level_probes(scenario)
    if len(world.ground) != len(probes):
        yield f"{len(world.ground)} places were measured, not {len(probes)}"
        return
    judged = [(p, g) for p, g in zip(probes, world.ground, strict=True) if g != "b"]
    for probe, ground in judged:
        if not isinstance(ground, float) or not _fits(probe, ground):
            yield f"at {probe.east:g} east, {probe.north:g} north {_describe_ground(ground, probe)}"
    heights = {probe.height > 0.0 for probe, _ in judged}
    if heights != {probe.height > 0.0 for probe in probes}:
        yield "the machine covers every place that would show which level is open"


def _fits(probe: Probe, ground: float) -> bool:
    tolerance, share = TERRAIN_TOLERANCE
    allowed = max(tolerance, share * probe.height) if probe.height > 0.0 else GROUND_TOLERANCE
    return abs(ground - probe.height) <= allowed  # false for NaN


def _describe_ground(ground: float | str | None, probe: Probe) -> str:
    if not isinstance(ground, float) or math.isnan(ground):
        return f"there is no ground, which should be at {probe.height:g}"
    return f"the ground is at {ground:.2f}, not at {probe.height:g}"
