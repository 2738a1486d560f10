"""Products of many small vectors at once, without the overhead of NumPy's general ones."""

import numpy as np

from buildarena_simulation.structure.model import FloatArray


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of the rows of two broadcastable (..., 3) arrays."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    first = a1 * b2 - a2 * b1
    product = np.empty((*first.shape, 3))
    product[..., 0] = first
    product[..., 1] = a2 * b0 - a0 * b2
    product[..., 2] = a0 * b1 - a1 * b0
    return product


def axis_frame(direction: FloatArray) -> FloatArray:
    """A right-handed frame whose first axis points along a vector, (3, 3), columns are the axes."""
    first = direction / np.linalg.norm(direction)
    helper = np.array([0.0, 0.0, 1.0]) if abs(first[2]) < 0.9 else np.array([0.0, 1.0, 0.0])  # noqa: PLR2004 - any vector well off the axis will do
    second = np.cross(helper, first)
    second /= np.linalg.norm(second)
    return np.column_stack([first, second, np.cross(first, second)])


def turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation by an angle about a unit axis (Rodrigues), (3, 3)."""
    x, y, z = axis
    cross_matrix = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(
        np.eye(3) + np.sin(angle) * cross_matrix + (1 - np.cos(angle)) * cross_matrix @ cross_matrix
    )


def turned(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    """Each vector (K, 3) turned by its rotation (K, 3, 3)."""
    return np.asarray((rotations @ vectors[:, :, None])[:, :, 0])


def turned_wrenches(rotations: FloatArray, wrenches: FloatArray) -> FloatArray:
    """Each wrench (K, 6), force and moment, turned by its rotation (K, 3, 3)."""
    both = wrenches.reshape(-1, 2, 3) @ rotations.transpose(0, 2, 1)
    return np.asarray(both.reshape(-1, 6))


def summed_by(index: np.ndarray, rows: FloatArray, count: int) -> FloatArray:
    """Sums of the rows (K, m) that share an index, (count, m); deterministic."""
    if not len(index):
        return np.zeros((count, rows.shape[1]))
    flat = index[:, None] * rows.shape[1] + np.arange(rows.shape[1])
    sums = np.bincount(flat.reshape(-1), rows.reshape(-1), minlength=count * rows.shape[1])
    return np.asarray(sums.reshape(count, -1), dtype=np.float64)
