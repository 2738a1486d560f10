"""Products of many small vectors at once, without the overhead of NumPy's general ones."""

from typing import Final

import numpy as np

from buildarena_simulation.structure.model import FloatArray, IntArray

_FORTH: Final = np.array([1, 2, 0])
_BACK: Final = np.array([2, 0, 1])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross products of the rows of two broadcastable (..., 3) arrays."""
    # `take` costs a third of an index, which is most of a product of few vectors.
    forth, back = _FORTH, _BACK
    return a.take(forth, -1) * b.take(back, -1) - a.take(back, -1) * b.take(forth, -1)


def axis_frame(direction: FloatArray) -> FloatArray:
    """Return a right-handed frame, axes as columns, (3, 3), its first axis along a vector."""
    first = direction / np.linalg.norm(direction)
    helper = np.array([0.0, 0.0, 1.0]) if abs(first[2]) < 0.9 else np.array([0.0, 1.0, 0.0])  # noqa: PLR2004 - any vector well off the axis will do
    second = np.cross(helper, first)
    second /= np.linalg.norm(second)
    return np.column_stack([first, second, np.cross(first, second)])


def turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """Return the rotation by an angle about a unit axis (Rodrigues), (3, 3)."""
    x, y, z = axis
    cross_matrix = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(
        np.eye(3) + np.sin(angle) * cross_matrix + (1 - np.cos(angle)) * cross_matrix @ cross_matrix
    )


def turned(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    """Turn each vector (K, 3) by its rotation (K, 3, 3)."""
    return np.asarray((rotations @ vectors[:, :, None])[:, :, 0])


def turned_wrenches(rotations: FloatArray, wrenches: FloatArray) -> FloatArray:
    """Turn each wrench (K, 6), force and moment, by its rotation (K, 3, 3)."""
    both = wrenches.reshape(-1, 2, 3) @ rotations.transpose(0, 2, 1)
    return np.asarray(both.reshape(-1, 6))


def summed_by(index: np.ndarray, rows: FloatArray, count: int) -> FloatArray:
    """Return the sums of the rows (K, m) that share an index, (count, m); deterministic."""
    if not len(index):
        return np.zeros((count, rows.shape[1]))
    return summed_at(columns_of(index, rows.shape[1]), rows, count)


def columns_of(index: np.ndarray, width: int) -> IntArray:
    """Return target indices of `summed_at` for rows (K, width) with an index each, (K · width,)."""
    return np.asarray(index[:, None] * width + np.arange(width)).reshape(-1)


def summed_at(columns: IntArray, rows: FloatArray, count: int) -> FloatArray:
    """Return the sums as `summed_by` does, for rows whose `columns_of` are known; at least one."""
    width = rows.shape[1]
    sums = np.bincount(columns, rows.reshape(-1), count * width)
    return np.asarray(sums.reshape(count, width), dtype=np.float64)
