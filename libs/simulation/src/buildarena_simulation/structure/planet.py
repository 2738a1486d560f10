"""A planet: what it pulls, where its air is, which way is up."""

from dataclasses import dataclass

import numpy as np

from buildarena_simulation.structure.model import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """The pull and the air around a ball below the origin, or above a plane.

    Attributes:
        gravity: Its pull on the ground, units/s².
        radius: Of the ball, which the origin lies on, units; None for a plane and the same air and
            pull everywhere.
        air: Drag on the ground as a share of the usual one.
        air_height: Height at which the air ends; up to there it thins out evenly, units.
    """

    gravity: float
    radius: float | None = None
    air: float = 1.0
    air_height: float = np.inf

    def pull(self, points: FloatArray) -> FloatArray:
        """What it accelerates masses by, (K, 3), units/s².

        It falls with the square of the distance from the centre; inside the ball, where only what
        came off and sank through the ground can be, it grows with the distance.

        Args:
            points: (K, 3) world frame, units.
        """
        if self.radius is None:
            return np.tile([0.0, 0.0, -self.gravity], (len(points), 1))
        arm = points + np.array([0.0, 0.0, self.radius])
        away = np.sqrt((arm * arm).sum(axis=1)) / self.radius
        return np.asarray(-(self.gravity / self.radius) * arm / np.maximum(away, 1.0)[:, None] ** 3)

    def up(self, points: FloatArray) -> FloatArray:
        """Which way is up, (K, 3), unit length."""
        if self.radius is None:
            return np.tile([0.0, 0.0, 1.0], (len(points), 1))
        arm = points + np.array([0.0, 0.0, self.radius])
        away = np.sqrt((arm * arm).sum(axis=1, keepdims=True))
        return np.asarray(arm / np.maximum(away, 1e-9))

    def height(self, points: FloatArray) -> FloatArray:
        """Heights above the ground, (K,), units."""
        if self.radius is None:
            return np.asarray(points[:, 2])
        arm = points + np.array([0.0, 0.0, self.radius])
        return np.asarray(np.sqrt((arm * arm).sum(axis=1)) - self.radius)

    def thinness(self, points: FloatArray) -> FloatArray:
        """Drag as a share of the usual one, (K,)."""
        if self.radius is None:
            return np.ones(len(points))
        share = 1.0 - self.height(points) / self.air_height
        return np.asarray(self.air * np.clip(share, 0.0, 1.0))
