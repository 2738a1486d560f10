"""Forces at points that push and never pull, of least energy among those of one resultant."""

from typing import Final

import numpy as np

from buildarena_simulation.structure.model import BoolArray, FloatArray

_SOFTNESS: Final = 1e-9
"""Lets resultants through that points in a line cannot bear; negligible else."""

_ROUNDS: Final = 12
_TOLERANCE: Final = 1e-9
"""A pull below this share of the resultant is none."""

_CLOSED: Final = 1e-10
"""The same for a gap, per mass·g of the resultant: a thousandth of what the ground yields."""

_MISMATCH: Final = 1e-3
"""Share of the resultant that may be missed before the even spread is kept."""


class LeastEnergy:
    """Finds the f >= 0 that minimises f·h·f / 2 - target·f with the resultant of a given f.

    Args:
        h: (P, P) positive definite.
        balance: (3, P) from forces to resultant.
    """

    def __init__(self, h: FloatArray, balance: FloatArray) -> None:
        self._h, self._balance = h, balance
        self._bearing: BoolArray = np.ones(len(h), dtype=bool)
        self._held = _Held(h, balance, self._bearing)

    def solve(self, target: FloatArray, forces: FloatArray) -> FloatArray | None:
        """The forces; None if none have the resultant.

        Args:
            target: (P,).
            forces: (P,) forces with the resultant that is wanted.
        """
        bearing, wanted = self._bearing, self._balance @ forces
        scale = float(np.abs(wanted).max()) + 1e-12
        for turn in range(_ROUNDS):
            if not bearing.any():
                break
            force, opening = self._with(bearing, target, wanted)
            pulling = force < -_TOLERANCE * scale
            # A point without load opens; where it would close again, it bears.
            closing = ~bearing & (opening < -_CLOSED * scale)
            if turn >= _ROUNDS // 2:
                closing[:] = False
            if not pulling.any() and not closing.any():
                break
            bearing = (bearing & ~pulling) | closing
        else:
            force = np.maximum(force, 0.0)
        if not bearing.any() or np.abs(self._balance @ force - wanted).max() > _MISMATCH * scale:
            self._bearing = np.ones(len(bearing), dtype=bool)
            return None
        self._bearing = bearing
        return force

    def _with(
        self, bearing: BoolArray, target: FloatArray, wanted: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Forces of points that bear, and how far the others open, each (P,)."""
        if self._held.bearing != bearing.tobytes():
            self._held = _Held(self._h, self._balance, bearing)
        held = self._held.points
        size = len(held)
        solution = self._held.solve(np.concatenate([target.take(held), wanted]))
        force = np.zeros(len(target))
        force[held] = solution[:size]
        opening = self._h @ force - target + solution[size:] @ self._balance
        return force, opening


class _Held:
    """The equations of the points that bear, factorised.

    Args:
        h: As in `LeastEnergy`.
        balance: As in `LeastEnergy`.
        bearing: (P,) which points bear.

    Attributes:
        bearing: The same as bytes.
        points: (S,) the points that bear.
    """

    def __init__(self, h: FloatArray, balance: FloatArray, bearing: BoolArray) -> None:
        from scipy.linalg import lapack, lu_factor

        self.bearing, self.points = bearing.tobytes(), bearing.nonzero()[0]
        held, size = self.points, len(self.points)
        matrix = np.zeros((size + 3, size + 3))
        matrix[:size, :size] = h[np.ix_(held, held)]
        matrix[:size, size:] = balance[:, held].T
        matrix[size:, :size] = balance[:, held]
        matrix[size:, size:] = -_SOFTNESS * np.eye(3)
        self._factors = lu_factor(matrix, check_finite=False)
        # What `lu_solve` calls, which takes ten times as long for some ten points.
        self._substitute = lapack.dgetrs

    def solve(self, right: FloatArray) -> FloatArray:
        """The solution (S + 3,) for a right-hand side (S + 3,)."""
        solution, failed = self._substitute(*self._factors, right)
        if failed:
            raise ValueError(f"dgetrs refuses argument {-failed}")
        return np.asarray(solution, dtype=np.float64)
