"""Whether the level that a script measured is the one that its trial needs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from buildarena_besiege.exporting.probes import Probe, level_probes
from buildarena_besiege.logs.log_lines import World
from buildarena_simulation import Scenario

GROUND_TOLERANCE: Final = 0.25
"""How uneven the ground itself may be, units."""

TERRAIN_TOLERANCE: Final = (0.1, 0.2)
"""How far a terrain's height may be off: so many units, or this share of it, whichever is more.

Public logs put the tops of the support tasks' boxes at about 4.5 instead of 5.
"""

GRAVITY_TOLERANCE: Final = 0.005
"""How far gravity may be off, as a share."""


def level_finding(world: World, scenario: Scenario) -> str | None:
    """What shows that another level than a trial's is open; None if nothing does.

    Args:
        world: What the script measured.
        scenario: What its terrain and gravity should be.
    """
    return next(_findings(world, scenario), None)


def _findings(world: World, scenario: Scenario) -> Iterator[str]:
    wanted = -scenario.gravity
    if not abs(world.gravity - wanted) <= GRAVITY_TOLERANCE * scenario.gravity:
        yield f"gravity is {world.gravity:.2f}, not {wanted:.2f}"
    probes = level_probes(scenario)
    if len(world.ground) != len(probes):
        yield f"{len(world.ground)} places were measured, not {len(probes)}"
        return
    judged = [(p, g) for p, g in zip(probes, world.ground, strict=True) if g != "b"]
    for probe, ground in judged:
        if not isinstance(ground, float) or not _fits(probe, ground):
            yield f"at {probe.east:g} east, {probe.north:g} north {_found(ground, probe)}"
    seen = {probe.height > 0.0 for probe, _ in judged}
    if seen != {probe.height > 0.0 for probe in probes}:
        yield "the machine covers every place that would show which level is open"


def _fits(probe: Probe, ground: float) -> bool:
    least, share = TERRAIN_TOLERANCE
    allowed = max(least, share * probe.height) if probe.height > 0.0 else GROUND_TOLERANCE
    return abs(ground - probe.height) <= allowed  # never true of what is no number


def _found(ground: float | str | None, probe: Probe) -> str:
    if not isinstance(ground, float) or math.isnan(ground):
        return f"there is no ground, which should be at {probe.height:g}"
    return f"the ground is at {ground:.2f}, not at {probe.height:g}"
