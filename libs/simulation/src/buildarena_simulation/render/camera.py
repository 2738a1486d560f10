"""A perspective camera that keeps a point in view."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from buildarena_simulation.structure.model import FloatArray

_NEAR = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """Viewpoint of a picture.

    Attributes:
        position: (3,) world frame, units.
        axes: (3, 3) rows: right, up and backwards of the camera, world frame.
        focal: Focal length, pixels.
        center: (2,) pixel the camera looks at.
    """

    position: FloatArray
    axes: FloatArray
    focal: float
    center: FloatArray

    @classmethod
    def looking_at(
        cls,
        target: FloatArray,
        *,
        distance: float,
        size: tuple[int, int],
        azimuth_deg: float = -55.0,
        elevation_deg: float = 18.0,
    ) -> Self:
        """Create a camera that looks at a point.

        Args:
            target: (3,) world frame, units.
            distance: Distance from the target, units.
            size: Width and height of the picture, pixels.
            azimuth_deg: Direction from the target: 0 is east, 90 north, degrees.
            elevation_deg: Angle above the horizon, degrees.
        """
        azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
        back = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        position = target + distance * back
        position[2] = max(position[2], 0.5)
        width, height = size
        return cls(
            position=position,
            axes=np.stack([right, np.cross(back, right), back]),
            focal=1.3 * min(width, height),
            center=np.array([width / 2, height / 2]),
        )

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return pixels (..., 2) of points (..., 3), and depths (...), which grow with distance."""
        local = (points - self.position) @ self.axes.T
        depth = -local[..., 2]
        scale = self.focal / np.maximum(depth, _NEAR)
        pixels = np.stack([local[..., 0] * scale, -local[..., 1] * scale], axis=-1) + self.center
        return pixels, depth
