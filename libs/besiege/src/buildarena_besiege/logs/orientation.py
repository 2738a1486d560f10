"""Rotation of a machine from its blocks' positions, and conversion of roots to centres.

The game reports the position of a block's root, not its rotation. Joined blocks move as one, so
three of them that are not in a line determine the machine's rotation.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry import Machine
from buildarena_geometry.rotations import Quaternion, multiply

Floats = NDArray[np.float64]


MIN_WIDTH: Final = 0.5
"""Distance from one line below which blocks give no rotation about it, units (root sum square)."""


MAX_MISFIT: Final = 0.25
"""Distance from its position in the machine beyond which a block does not move with it, units."""


def initial_quaternions(machine: Machine, block_ids: tuple[str, ...], turn: Quaternion) -> Floats:
    """Return world_from_block of each block as the game places the machine, (N, 4).

    Args:
        turn: (w, x, y, z) rotation of the machine by the game, world components.
    """
    rows = [
        multiply(turn, machine.blocks[block_id].world_from_block.wxyz) for block_id in block_ids
    ]
    return np.array(rows, np.float64).reshape(len(block_ids), 4)


def machine_rotations(built: Floats, roots: Floats, joined: NDArray[np.bool_]) -> Floats | None:
    """Return the machine's rotation from its start by least squares, (T, 3, 3).

    A sample of which too little is known keeps the rotation before.

    Args:
        built: (N, 3) the blocks' roots as the machine was put, units.
        roots: (T, N, 3) their roots at each sample, units.
        joined: (T, N) which blocks still hold together.

    Returns:
        None when the blocks give no rotation at the start, or are not where they were put.

    Source: W. Kabsch, Acta Cryst. A32 (1976) 922.
    """
    weights = joined.astype(np.float64)
    counts = np.maximum(weights.sum(axis=1), 1.0)
    middles = np.einsum("tn,nk->tk", weights, built) / counts[:, None]
    centers = np.einsum("tn,tnk->tk", weights, roots) / counts[:, None]
    before = (built[None] - middles[:, None]) * weights[:, :, None]
    after = (roots - centers[:, None]) * weights[:, :, None]
    widths = np.linalg.svd(before, compute_uv=False)
    determined = (np.isfinite(after).all(axis=(1, 2))) & (joined.sum(axis=1) > 2)  # noqa: PLR2004
    determined &= widths[:, 1] > MIN_WIDTH if widths.shape[1] > 1 else False
    if not len(determined) or not determined[0]:
        return None
    left, _, right = np.linalg.svd(np.einsum("tni,tnj->tij", after[determined], before[determined]))
    mirrored = np.linalg.det(left @ right) < 0.0
    left[mirrored, :, 2] *= -1.0
    rotations = np.tile(np.eye(3), (len(roots), 1, 1))
    rotations[determined] = left @ right
    fit = after[0] - before[0] @ rotations[0].T
    if np.sqrt((fit**2).sum() / counts[0]) > MAX_MISFIT:
        return None
    latest = np.maximum.accumulate(np.where(determined, np.arange(len(determined)), 0))
    return np.asarray(rotations[latest])


def turned(rotations: Floats, placed: Floats) -> Floats:
    """Return quaternions of blocks that turn with the machine, (T, N, 4).

    Args:
        rotations: (T, 3, 3) of the machine.
        placed: (N, 4) of each block as it was put.
    """
    from scipy.spatial.transform import Rotation

    machine = Rotation.from_matrix(rotations).as_quat(canonical=True)[:, None, [3, 0, 1, 2]]
    return _product(machine, placed[None])


def centers_of(
    machine: Machine, block_ids: tuple[str, ...], roots: Floats, turns: Floats
) -> Floats:
    """Return the blocks' centres, (T, N, 3), units.

    Args:
        machine: Gives each block's centre in its own frame.
        block_ids: (N,) the blocks.
        roots: (T, N, 3) their roots, units.
        turns: (T, N, 4) world_from_block.
    """
    own = np.array([machine.blocks[block_id].module.center for block_id in block_ids], np.float64)
    vectors = np.concatenate([np.zeros((len(own), 1)), own.reshape(-1, 3)], axis=1)[None]
    conjugate = turns * np.array([1.0, -1.0, -1.0, -1.0])
    return np.asarray(roots + _product(_product(turns, vectors), conjugate)[..., 1:])


def _product(left: Floats, right: Floats) -> Floats:
    """Multiply the quaternions (w, x, y, z), the right one turning first."""
    a, b, c, d = np.moveaxis(left, -1, 0)
    e, f, g, h = np.moveaxis(right, -1, 0)
    return np.stack(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ],
        axis=-1,
    )
