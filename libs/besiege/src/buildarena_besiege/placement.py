"""Poses of a machine and its cargo in the game by the published runner's rules.

All means and extents are of the parts' centres in Besiege's components (x east, y up, z north),
each part with weight 1; a connector's centre is where its own frame is. The published rule centres
a turned machine with the wrong sign; this one does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_point
from buildarena_geometry.blocks import Block
from buildarena_geometry.rotations import NO_ROTATION, Quaternion, Vector
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import SpanPlacement

START_HEIGHT: Final = 5.0
"""Height of a machine's origin where "set ground" puts it on the floor afterwards, units."""

QUARTER_TURN: Final[Quaternion] = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
"""(w, x, y, z) about the vertical, Besiege's components: takes +z to +x and +x to -z."""

UPRIGHT_CARGO: Final[Quaternion] = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)
"""(w, x, y, z): the cargo's own z axis points up."""


_TIE: Final = 1e-9  # units; what rounding may make of equal extents


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalPose:
    """A machine file's Global: Besiege's components.

    Attributes:
        position: (3,) units.
        rotation: (w, x, y, z).
    """

    position: Vector
    rotation: Quaternion = NO_ROTATION

    @property
    def turned(self) -> bool:
        """True if the machine is turned by a quarter."""
        return self.rotation != NO_ROTATION


AS_BUILT: Final = GlobalPose(position=(0.0, START_HEIGHT, 0.0))
"""Pose of a machine without a trial."""


def global_pose(machine: Machine, scenario: Scenario) -> GlobalPose:
    """Return the pose of a machine in a trial.

    Args:
        machine: Machine with at least one block.
        scenario: Scenario with placement and control.
    """
    centers = centers_of(machine)
    east, north = _mean(centers, 0), _mean(centers, 2)
    placement = scenario.placement
    if not isinstance(placement, SpanPlacement):
        if scenario.control.mode != "agent":
            return AS_BUILT
        return GlobalPose(position=(-east, START_HEIGHT, -north))
    height = placement.lowest_center - min(center[1] for center in centers)
    wide, long = _extent(centers, 0), _extent(centers, 2)
    if long <= placement.gap + _TIE and wide >= long - _TIE:
        return GlobalPose(position=(-north, height, east), rotation=QUARTER_TURN)
    return GlobalPose(position=(-east, height, -north))


def cargo_root(machine: Machine, drop_height: float) -> Vector:
    """Return the centre of the cargo's underside at the start, in the machine's components.

    Args:
        machine: Machine with at least one block.
        drop_height: Height of the underside above the highest centre, units.
    """
    centers = centers_of(machine)
    highest = max(center[1] for center in centers)
    return (_mean(centers, 0), highest + drop_height, _mean(centers, 2))


def centers_of(machine: Machine) -> list[Vector]:
    """Return the centres of all parts, Besiege's components, units.

    Raises:
        MachineNotPlayableError: The machine has no parts.
    """
    if not machine.blocks:
        raise MachineNotPlayableError("The machine has no blocks.")
    return [
        besiege_point(part.center_xyz if isinstance(part, Block) else part.world_from_connector.xyz)
        for part in machine.state.parts
    ]


def _mean(centers: list[Vector], axis: int) -> float:
    return math.fsum(center[axis] for center in centers) / len(centers)


def _extent(centers: list[Vector], axis: int) -> float:
    values = [center[axis] for center in centers]
    return max(values) - min(values)
