"""Connectivity: the blocks still joined to the starting block."""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.series import starting_block
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

Mask = NDArray[np.bool_]


def joined_to_start(machine: "Machine", trajectory: "Trajectory") -> Mask:
    """Return which tracked blocks are joined to the starting block at each sample, (T, N).

    Joints, axles, braces and ropes join as long as they hold; of several starting blocks the first
    counts. Without pieces in the trajectory, all blocks are joined.
    """
    groups = groups_of(machine, trajectory)
    if groups is None:
        return np.ones(trajectory.positions.shape[:2], dtype=bool)
    start = starting_block(machine, trajectory)
    return np.asarray(groups == groups[:, start, None])


def groups_of(machine: "Machine", trajectory: "Trajectory") -> NDArray[np.int16] | None:
    """Return the groups of tracked blocks that are still joined, (T, N); None if not known.

    Joints, axles, braces and ropes join; blocks of one number are joined.
    """
    pieces = trajectory.pieces
    if pieces is None:
        return None
    ropes = _ropes(machine, trajectory)
    rope_ends = np.searchsorted(trajectory.time_s, [end for _, _, end in ropes])
    groups = pieces.copy()
    for first, last in spans_of(pieces, rope_ends.tolist()):
        row, time_s = pieces[first], trajectory.time_s[first]
        ties = [(row[a], row[b]) for a, b, end in ropes if time_s < end]
        for piece in np.unique(row):
            reached = _reach(piece, ties)
            groups[first:last, np.isin(row, reached)] = min(reached)
    return groups


def spans_of(pieces: NDArray[np.int16], extra: Iterable[int] = ()) -> Iterator[tuple[int, int]]:
    """Yield first sample, and the one after the last, of each time in which no piece breaks.

    Args:
        pieces: (T, N) as in `Trajectory`.
        extra: Additional samples at which an interval begins.
    """
    changed = np.flatnonzero(np.any(np.diff(pieces, axis=0) != 0, axis=1)) + 1
    yield from pairwise(sorted({0, len(pieces), *changed.tolist(), *extra}))


def _ropes(machine: "Machine", trajectory: "Trajectory") -> list[tuple[int, int, float]]:
    """Return tracked blocks that a rope or spring ties, and when it gives way, seconds."""
    index = {block: i for i, block in enumerate(trajectory.block_ids)}
    broken = {event.joint: event.time_s for event in trajectory.breaks if event.kind == "rope"}
    ties = [
        (link.start[0], link.end[0], f"{link.module.name} {key}")
        for key, link in machine.connectors.items()
        if link.module.link in {"rope", "spring"}
    ]
    if any(block.module.rope_mount for block in machine.blocks.values()):
        ties += [
            (joint.base, joint.part, f"{joint.base}-{joint.part}")
            for joint in machine.joints
            if joint.holds and machine.blocks[joint.part].module.rope_mount
        ]
    return [
        (index[first], index[second], broken.get(name, np.inf))
        for first, second, name in ties
        if first in index and second in index
    ]


def _reach(piece: int, ties: list[tuple[int, int]]) -> list[int]:
    reached = {piece}
    grown = True
    while grown:
        linked = {b for a, b in ties if a in reached} | {a for a, b in ties if b in reached}
        grown = not linked <= reached
        reached |= linked
    return list(reached)
