"""Forces at points that push and never pull, of least energy among those of one resultant."""

from typing import Final

import numpy as np

from buildarena_simulation.structure.model import BoolArray, FloatArray

_SOFTNESS: Final = 1e-9
"""Compliance that admits resultants which points in a line cannot take; negligible otherwise."""

_ROUNDS: Final = 12
_TOLERANCE: Final = 1e-9
"""Share of the resultant below which a pull is negligible."""

_CLOSED: Final = 1e-10
"""The same for a gap, per mass·g of the resultant: a thousandth of the ground's compliance."""

_MISMATCH: Final = 1e-3
"""Maximum error of the resultant, as a share; beyond it the even spread is kept."""


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
        """Return the forces; None if none have the resultant.

        Args:
            target: (P,).
            forces: (P,) forces with the required resultant.
        """
        bearing, resultant = self._bearing, self._balance @ forces
        scale = float(np.abs(resultant).max()) + 1e-12
        for turn in range(_ROUNDS):
            if not bearing.any():
                break
            force, opening = self._with(bearing, target, resultant)
            pulling = force < -_TOLERANCE * scale
            # A point without load opens; one that would close again is loaded.
            closing = ~bearing & (opening < -_CLOSED * scale)
            if turn >= _ROUNDS // 2:
                closing[:] = False
            if not pulling.any() and not closing.any():
                break
            bearing = (bearing & ~pulling) | closing
        else:
            force = np.maximum(force, 0.0)
        if not bearing.any() or np.abs(self._balance @ force - resultant).max() > _MISMATCH * scale:
            self._bearing = np.ones(len(bearing), dtype=bool)
            return None
        self._bearing = bearing
        return force

    def _with(
        self, bearing: BoolArray, target: FloatArray, resultant: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the forces of loaded points, and the gaps of the others, each (P,)."""
        if self._held.bearing != bearing.tobytes():
            self._held = _Held(self._h, self._balance, bearing)
        held = self._held.points
        size = len(held)
        solution = self._held.solve(np.concatenate([target.take(held), resultant]))
        force = np.zeros(len(target))
        force[held] = solution[:size]
        opening = self._h @ force - target + solution[size:] @ self._balance
        return force, opening


class _Held:
    """Factorised equations of the loaded points.

    Args:
        h: See `LeastEnergy`.
        balance: See `LeastEnergy`.
        bearing: (P,) true for loaded points.

    Attributes:
        bearing: The same as bytes.
        points: (S,) loaded points.
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
        """Return the solution (S + 3,) for a right-hand side (S + 3,)."""
        solution, failed = self._substitute(*self._factors, right)
        if failed:
            raise ValueError(f"dgetrs refuses argument {-failed}")
        return np.asarray(solution, dtype=np.float64)
