"""Two wheels on one axle: their recognition, its turning, and the height of mass above it."""

from typing import Final

import numpy as np

from buildarena_benchmark.scoring.measures.masses import center_of
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, rotations

_WHEELS: Final = 2
_EAST: Final = np.array([1.0, 0.0, 0.0])
_LEVEL_DEG: Final = 3.0
"""Largest turn of an axle from east at the start: a seed turns machines by up to 2."""

_PARALLEL_DEG: Final = 0.5
_APART: Final = 0.02
"""Largest distance of one wheel's middle from the line through the other's axle, units."""


def two_wheels(run: Run) -> list[int] | None:
    """Return the tracked blocks that are wheels, if they are two on one axle from east to west.

    Both turn about one line, which is level. None where they do not, there are others, or they are
    not tracked.
    """
    names = [name for name, block in run.machine.blocks.items() if block.module.kind == "wheel"]
    wheels = [
        run.trajectory.block_ids.index(name) for name in names if name in run.trajectory.block_ids
    ]
    if len(names) != _WHEELS or len(wheels) != _WHEELS:
        return None
    first, second = (_axles(run, wheel)[0] for wheel in wheels)
    offset = np.subtract(*run.positions[0, wheels])
    on_one_line = float(np.linalg.norm(offset - (offset @ first) * first)) <= _APART
    is_axle = on_one_line and _between(first, second) <= _PARALLEL_DEG
    return wheels if is_axle and _between(first, _EAST) <= _LEVEL_DEG else None


def axle_turn_deg(run: Run, wheels: list[int]) -> Series:
    """Return the greatest angle of some axles with the line from west to east, (T,), degrees."""
    axles = np.array([_axles(run, wheel) for wheel in wheels])
    return np.asarray(_between(axles, _EAST).max(axis=0))


def height_over_wheels(run: Run, wheels: list[int]) -> Series:
    """Return the height of the centre of mass over the middle of some wheels, (T,), units."""
    middle = run.positions[:, wheels, 2].mean(axis=1)
    return np.asarray(center_of(run)[:, 2] - middle)


def lean_deg(run: Run, block: int) -> Series:
    """Return the angle from the vertical of a block's upward axis as built, (T,), degrees."""
    built = run.machine.blocks[run.trajectory.block_ids[block]].world_from_block.rotation
    up = np.array(built).T @ np.array([0.0, 0.0, 1.0])
    cosine = (rotations(run.trajectory.quaternions[:, block]) @ up)[:, 2]
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _axles(run: Run, wheel: int) -> Series:
    """Return the direction of a wheel's axle, (T, 3), world frame."""
    return rotations(run.trajectory.quaternions[:, wheel])[:, :, 2]


def _between(axles: Series, line: Series) -> Series:
    """Return the angle between lines, degrees, whichever way they point."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.abs(axles @ line), 0.0, 1.0))))
