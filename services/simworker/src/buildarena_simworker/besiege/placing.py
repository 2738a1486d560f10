"""Whether the game put a machine where its file and the task say."""

from __future__ import annotations

from typing import Final

from buildarena_besiege import GameRun, LogIncompleteError
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

FALLEN_S: Final = 0.1
"""Until then a machine has fallen by less than 0.2 units."""
HIGHEST_START: Final = 1.5
"""How far above its place on the ground a machine may be shown at first, units."""


def require_placed(trajectory: Trajectory, machine: Machine, run: GameRun) -> Trajectory:
    """Gives the trajectory back if its machine was on the ground at the start where it should be.

    The button that puts a machine on the ground shows nothing that could be checked; a machine
    that it missed starts several units higher, and would be scored for its fall.

    Raises:
        LogIncompleteError: It was not.
    """
    if not run.set_ground or not len(trajectory.block_ids):
        return trajectory
    lowest = float(machine.bounds[0][2])
    block = machine.blocks[trajectory.block_ids[0]]
    height = float(trajectory.positions[0, 0, 2])
    above = height - (block.center_xyz[2] - lowest)
    if above > HIGHEST_START:
        raise LogIncompleteError(
            f"the machine started {above:.1f} units above the ground: it was not put down"
        )
    return trajectory
