"""The start of a trial as the game has it, for our own engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from buildarena_besiege.placement import cargo_root, global_pose
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_point, besiege_turn
from buildarena_geometry.poses import Pose
from buildarena_simulation import Scenario
from buildarena_simulation.machine import structure_of
from buildarena_simulation.placement import Start, start_of
from buildarena_simulation.scenario import SpanPlacement


def game_start(machine: Machine, scenario: Scenario) -> Start:
    """Where the game puts machine and cargo: what an engine must be given to be compared with it.

    Our own placement is by the machine's outline, the game's by the mean of its parts' centres.

    Args:
        machine: The machine.
        scenario: What it is put through.

    Raises:
        MachineNotPlayableError: The game cannot take the machine.
        MachineNotSimulable: Our engines cannot.
    """
    ours = start_of(structure_of(machine), scenario)
    put = global_pose(machine, scenario)
    pose = Pose(position=besiege_point(put.position), quaternion=besiege_turn(put.rotation))
    position = np.array(pose.xyz)
    if not isinstance(scenario.placement, SpanPlacement):
        # "Set ground" moves a machine down only; ours starts at the same height above the floor.
        position[2] = ours.position[2]
    axes = [pose.direction(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    rotation = np.array(axes).T
    cargo = ours.cargo
    if cargo is not None and scenario.cargo is not None:
        root = np.array(besiege_point(cargo_root(machine, scenario.cargo.drop_height)))
        center = rotation @ root + position + np.array([0.0, 0.0, scenario.cargo.size[2] / 2])
        cargo = replace(cargo, position=center)
    return Start(position=position, rotation=rotation, cargo=cargo)
