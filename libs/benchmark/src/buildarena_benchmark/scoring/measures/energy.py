"""Energy balance of machines without drives."""

from typing import Final

import numpy as np

from buildarena_benchmark.scoring.measures.commands import keys_of, presses_of
from buildarena_benchmark.scoring.measures.masses import masses_of_blocks
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import (
    LASTING,
    Series,
    is_lasting,
    lifted,
    release_speed,
)
from buildarena_geometry import Block
from buildarena_simulation import Scenario

SHARE: Final = 0.05
"""By which share of its energy at the release a machine may have more: engines are not exact."""

RISE: Final = 0.5
"""By how much it may besides, as a height to which all of it is raised, units."""


def gains_energy(run: Run, samples: int) -> bool:
    """Return whether machine and cargo gain energy beyond what the growing cargo brings.

    Energies are those of the blocks' and the cargo's centres, of motion and height. Where
    something drives the machine (a key, a balloon, a spring, wind, a push), or not all of it was
    recorded, that is not known, and it does not.

    Args:
        samples: Number of samples to examine, from the first on.
    """
    all_tracked = set(run.trajectory.block_ids) == set(run.machine.blocks)
    if not all_tracked or samples <= LASTING or _is_driven(run):
        return False
    time_s, gravity = run.time_s[:samples], run.scenario.gravity
    masses = masses_of_blocks(run)
    positions = run.positions[:samples]
    total_mass = float(masses.sum())
    energy = _energies(run.scenario, time_s, positions) @ masses
    released = total_mass * release_speed(run.scenario) ** 2 / 2 + float(
        lifted(run.scenario, positions[0]) @ masses
    )
    brought = np.zeros(samples - 1)
    if run.trajectory.cargo_position is not None:
        cargo = run.cargo_mass[:samples]
        path = run.cargo_path[:samples]
        each = _energies(run.scenario, time_s, path[:, None])[:, 0]
        energy = energy + cargo[1:] * each
        released += gravity * float(path[0, 2]) * float(cargo[0])
        brought = np.cumsum(np.diff(cargo) * each)
        total_mass += float(cargo[0])
    limit = (released + brought) * (1.0 + SHARE) + RISE * gravity * total_mass
    return is_lasting(energy > limit)


def _energies(scenario: "Scenario", time_s: Series, positions: Series) -> Series:
    """Return the energy per mass of points in each step, (T - 1, N), units²/s²."""
    speed = np.diff(positions, axis=0) / np.diff(time_s)[:, None, None]
    middle = (positions[1:] + positions[:-1]) / 2
    return np.asarray((speed**2).sum(axis=2) / 2 + lifted(scenario, middle))


def _is_driven(run: Run) -> bool:
    blocks = run.machine.blocks.values()
    if any(_drives_itself(block) for block in blocks):
        return True
    if run.scenario.gusts is not None or run.scenario.pushes:
        return True
    if any(link.module.spring for link in run.machine.connectors.values()):
        return True
    if run.scenario.control.mode == "constant":
        return any(block.module.thrust for block in blocks)
    bound = {key for block in blocks for action in block.bindings for key in keys_of(block, action)}
    pressed = {press.key for press in presses_of(run)}
    return run.scenario.control.mode == "agent" and bool(bound & pressed)


def _drives_itself(block: "Block") -> bool:
    """Return whether a block moves, lifts or pushes with no key pressed."""
    module = block.module
    joint = module.joint
    runs = joint is not None and joint.drive is not None and joint.drive.default_mode == "forward"
    return runs or bool(module.lift or module.altitude)
