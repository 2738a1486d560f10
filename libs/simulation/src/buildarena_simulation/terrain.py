"""The fixed boxes of a scenario as shapes."""

import numpy as np

from buildarena_simulation.scenario import TerrainBox
from buildarena_simulation.structure.model import Shape, ShapeKind
from buildarena_simulation.structure.vectors import turn_about


def shape_of(box: TerrainBox) -> Shape:
    """Return a box in the world: tilted about the east-west axis through its centre, and turned."""
    tilt = np.radians(box.slope_deg)
    cosine, sine = np.cos(tilt), np.sin(tilt)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    if box.heading_deg:
        rotation = turn_about(np.array([0.0, 0.0, 1.0]), -np.radians(box.heading_deg)) @ rotation
    return Shape(
        kind=ShapeKind.BOX,
        center=np.array(box.center),
        rotation=rotation,
        half_extents=np.array(box.size) / 2,
    )
