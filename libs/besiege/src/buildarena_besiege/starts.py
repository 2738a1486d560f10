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
    """Return the start of machine and cargo in the game, for comparison with an engine.

    The engines place by the machine's outline, the game by the mean of its parts' centres.

    Raises:
        MachineNotPlayableError: The game cannot load the machine.
        MachineNotSimulable: The engines cannot.
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
