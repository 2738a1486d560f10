"""Masses of machines and of what is left of them, and their centres."""

import math
from itertools import pairwise

import numpy as np

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series


def mass_of(run: Run, members: Mask) -> float:
    """Return the mass of some of the tracked blocks, with half of each connector that ends on one.

    Args:
        run: Has the tracked blocks; others count as members.
        members: (N,) bool, of the tracked blocks.
    """
    lost = {i for i, member in zip(run.trajectory.block_ids, members, strict=True) if not member}
    blocks = [block.module.mass for block in run.machine.blocks.values() if block.id not in lost]
    halves = [
        link.mass / 2
        for link in run.machine.connectors.values()
        for end in (link.start[0], link.end[0])
        if end not in lost
    ]
    return math.fsum([*blocks, *halves])


def whole_mass(run: Run) -> float:
    """Return the mass of everything that was built, mass units."""
    return mass_of(run, np.ones(run.joined.shape[1], dtype=bool))


def joined_masses(run: Run) -> Series:
    """Return the mass of what is joined to the starting block at each sample, (T,)."""
    members = run.joined
    masses = np.empty(len(members))
    changed = np.flatnonzero(np.any(members[1:] != members[:-1], axis=1)) + 1
    for first, last in pairwise([0, *changed.tolist(), len(members)]):
        masses[first:last] = mass_of(run, members[first])
    return masses


def center_of(run: Run) -> Series:
    """Return the centre of mass of what is joined to the starting block, (T, 3), units.

    A block's mass lies at its centre, and half of each connector's there as well.
    """
    weights = masses_of_blocks(run) * run.joined
    center = np.einsum("tn,tnk->tk", weights, run.positions)
    return np.asarray(center / np.maximum(weights.sum(axis=1), 1e-9)[:, None])


def masses_of_blocks(run: Run) -> Series:
    """Return each tracked block's mass, (N,), with half of each connector on it, mass units."""
    index = {block: i for i, block in enumerate(run.trajectory.block_ids)}
    masses = run.block_masses.copy()
    for link in run.machine.connectors.values():
        for end in (link.start[0], link.end[0]):
            if end in index:
                masses[index[end]] += link.mass / 2
    return masses
