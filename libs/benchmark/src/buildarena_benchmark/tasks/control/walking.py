"""Feet: parts of a machine that touch ground and terrain, and their ways through the air."""

from collections.abc import Iterator
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.outline import extents
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, rotations
from buildarena_geometry import Block, Machine
from buildarena_geometry.modules.joints import MOVING_JOINTS
from buildarena_geometry.modules.solids import Ball, Cylinder, Solid
from buildarena_simulation.scenario import TerrainBox
from buildarena_simulation.terrain import shape_of

_NORTH: Final = 1
TOUCHES: Final = 0.05
"""Height above ground or terrain that counts as touching, units: bodies sink in by 0.02,
and a tilted face is looked at every half unit."""

_APART: Final = 0.5
"""Greatest distance of the points of a body that are looked at, units."""

_ROUND: Final = 12


def links_of(run: Run) -> NDArray[np.intp]:
    """Return which link each tracked block belongs to, (N,), numbered from 0.

    A link is what is joined by other joints than those that move, and by rigid connectors.
    """
    link = {block: block for block in run.machine.blocks}

    def root(block: str) -> str:
        while link[block] != block:
            block = link[block]
        return block

    for base, part in _rigid(run.machine):
        link[root(part)] = root(base)
    roots = [root(block) for block in run.trajectory.block_ids]
    return np.unique(roots, return_inverse=True)[1]


def touching(run: Run, links: NDArray[np.intp]) -> Mask:
    """Return which links touch ground or terrain, (T, L): some point of theirs is within `TOUCHES`.

    Judged by where their bodies are, since forces are only known of the machine as a whole. What is
    looked at are the corners of each body, and points of its surface at most 0.5 apart.

    Args:
        links: (N,) as `links_of` returns.
    """
    low, _ = extents(run, axis=2)
    tops = [0.0, *(_top(box) for box in run.scenario.terrain)]
    touches = np.zeros((len(low), int(links.max()) + 1), dtype=bool)
    for column, name in enumerate(run.trajectory.block_ids):
        low_samples = np.flatnonzero(low[:, column] <= max(tops) + TOUCHES)
        if low_samples.size:
            points = _points(run.machine.blocks[name], run, column, low_samples)
            heights = np.stack([points[..., 2], *_over(run.scenario.terrain, points)]).min(axis=0)
            touches[low_samples, links[column]] |= heights.min(axis=1) <= TOUCHES
    return touches


def stepped(run: Run, links: NDArray[np.intp], touches: Mask) -> Series:
    """Return how far other feet carry each link northwards through the air, (T, L).

    From one sample to the next a link counts that touches at neither of them, while some other
    touches at both: by how much farther it moves than that other, of several the one that moves
    least. So what slides carries nothing. A link is where the mean of its blocks is.

    Args:
        links: (N,) as `links_of` returns.
        touches: (T, L) as `touching` returns.
    """
    places = run.positions[:, :, _NORTH]
    members = np.eye(touches.shape[1])[links]
    moves = np.diff(places @ (members / members.sum(axis=0)), axis=0)
    rests = touches[1:] & touches[:-1]
    hangs = ~touches[1:] & ~touches[:-1]
    slowest = np.where(rests, np.abs(moves), np.inf).argmin(axis=1)
    base = np.take_along_axis(moves, slowest[:, None], axis=1)
    carried = np.where(hangs & rests.any(axis=1, keepdims=True), moves - base, 0.0)
    return np.asarray(np.vstack([np.zeros(touches.shape[1]), carried]))


def walked(run: Run, links: NDArray[np.intp], touches: Mask) -> Series:
    """Return how far north a machine has walked, (T,), units.

    The least of how far the starting block came, how far its hindmost point did, and how far each
    foot was carried: each link that has touched anything until then.

    Args:
        links: (N,) as `links_of` returns.
        touches: (T, L) as `touching` returns.
    """
    start = run.trajectory.positions[:, run.start, _NORTH]
    low, _ = extents(run, axis=_NORTH)
    rear = low.min(axis=1)
    carried = np.cumsum(stepped(run, links, touches), axis=0)
    is_foot = np.maximum.accumulate(touches, axis=0)
    feet = np.where(is_foot, carried - carried[0], np.inf).min(axis=1)
    return np.asarray(np.minimum(np.minimum(start - start[0], rear - rear[0]), feet))


def _rigid(machine: "Machine") -> Iterator[tuple[str, str]]:
    for joint in machine.joints:
        physics = machine.blocks[joint.part].module.physics
        if joint.holds and physics is not None and physics.joint_type not in MOVING_JOINTS:
            yield joint.base, joint.part
    for link in machine.connectors.values():
        if link.module.link == "rigid":
            yield link.start[0], link.end[0]


def _points(block: "Block", run: Run, column: int, samples: NDArray[np.intp]) -> Series:
    """Return the points of a block's body at some samples, (S, P, 3), world frame, units."""
    own = np.concatenate([_surface(solid) for solid in block.module.body])
    turns = rotations(run.trajectory.quaternions[samples, column])
    places = run.positions[samples, column]
    shown = own - np.array(block.module.center)
    return np.asarray(np.einsum("sij,pj->spi", turns, shown) + places[:, None])


def _surface(solid: "Solid") -> Series:
    """Return the points of a solid, (P, 3), block frame, units."""
    if isinstance(solid, Ball):
        ways = np.array([way for way in product((-1, 0, 1), repeat=3) if any(way)], dtype=float)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        return np.asarray(np.array(solid.center) + solid.radius * ways)
    if isinstance(solid, Cylinder):
        pose, turn = solid.block_from_axis, np.arange(_ROUND) * 2 * np.pi / _ROUND
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=1) * solid.radius
        along = _ticks(-solid.length / 2, solid.length / 2)
        own = np.array([(x, y, z) for z in along for x, y in ring])
        return np.asarray(own @ np.array(pose.rotation).T + np.array(pose.position))
    ticks = [_ticks(low, high) for low, high in zip(solid.lowest, solid.highest, strict=True)]
    return np.array(list(product(*ticks)))


def _ticks(low: float, high: float) -> Series:
    return np.linspace(low, high, int(np.ceil((high - low) / _APART)) + 1)


def _over(terrain: tuple["TerrainBox", ...], points: Series) -> Iterator[Series]:
    """Yield the height of points above each box's top, infinite next to or below the box."""
    for box in terrain:
        shape = shape_of(box)
        own = (points - shape.center) @ shape.rotation
        outside = (np.abs(own[..., :2]) > shape.half_extents[:2]).any(axis=-1)
        below = own[..., 2] < -shape.half_extents[2]
        yield np.where(outside | below, np.inf, own[..., 2] - shape.half_extents[2])


def _top(box: "TerrainBox") -> float:
    shape = shape_of(box)
    return float(shape.center[2] + np.abs(shape.rotation[2]) @ shape.half_extents)
