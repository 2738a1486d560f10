"""Whether a log whose first samples are missing still shows that its trial began as it should."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.starts import game_start
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.constants import GRAVITY, SAMPLE_RATE_HZ
from buildarena_simulation.errors import MachineNotSimulable

SLACK: Final = 0.5
"""How far from where it should start a block may be at the first sample, besides what it may have
fallen; units."""


def proved_start(
    machine: Machine,
    scenario: Scenario,
    tracked: tuple[str, ...],
    first: Sequence[tuple[int, NDArray[np.float64]] | None],
) -> NDArray[np.bool_]:
    """(N,) of which reported blocks the first sample proves where they were at the start.

    Nothing falls faster than freely: a first sample that is no farther from the start than that
    can only be of a trial that began there.

    Args:
        machine: What was played.
        scenario: What it was put through.
        tracked: The reported blocks, the cargo apart.
        first: For each reported block, the cargo last, the late first sample and its position in
            Besiege's components; None where it is not late.
    """
    proved = np.zeros(len(first), dtype=bool)
    if all(sample is None for sample in first):
        return proved
    try:
        roots = _start_roots(machine, scenario, tracked)
    except (MachineNotPlayableError, MachineNotSimulable):
        return proved
    for column, sample in enumerate(first):
        if sample is not None:
            time_s = sample[0] / SAMPLE_RATE_HZ
            reach = SLACK + GRAVITY * time_s**2 / 2
            proved[column] = float(np.linalg.norm(sample[1] - roots[column])) <= reach
    return proved


def _start_roots(
    machine: Machine, scenario: Scenario, tracked: tuple[str, ...]
) -> NDArray[np.float64]:
    """(N, 3) where the reported blocks' roots are at the start, Besiege's components."""
    start = game_start(machine, scenario)
    roots = [
        start.rotation @ np.array(machine.blocks[block].world_from_block.xyz) + start.position
        for block in tracked
    ]
    if scenario.cargo is not None and start.cargo is not None:
        under = np.array([0.0, 0.0, scenario.cargo.size[2] / 2])
        roots.append(np.asarray(start.cargo.position) - under)
    return np.array(roots).reshape(-1, 3)[:, [0, 2, 1]]
