"""Blocks that hold what comes near their far ends."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.structure.model import FloatArray, Part, Shape, ShapeKind, Structure

_GRID: Final = np.array([[x, y] for x in (-0.9, 0.0, 0.9) for y in (-0.9, 0.0, 0.9)])
"""Points of an end face from which distances are measured, as shares of its half-extents."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """Hold of a grip on a block, the cargo or the world.

    Attributes:
        grip: Index of the grip.
        block: Block that holds.
        other: Block that is held, `CARGO`, or `WORLD`.
        point: (3,) point of the hold, machine frame of the holding block, units.
    """

    grip: int
    block: int
    other: int
    point: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Grips:
    """The blocks that hold; G of them.

    Attributes:
        blocks: Their indices.
        tips: (G, 3) middles of their far ends, machine frame, units.
        places: (G, 9, 3) points of their far ends, machine frame, units.
        reach: (G,) how near a thing must come, units.
        limits: (G, 2) force and moment at which a hold slips, mass·g and mass·g·unit.
    """

    blocks: tuple[int, ...]
    tips: FloatArray
    places: FloatArray
    reach: FloatArray
    limits: FloatArray

    def __len__(self) -> int:
        return len(self.blocks)


def grips_of(structure: Structure) -> Grips:
    """Return the blocks of a structure that hold."""
    gripping = [
        (i, part, part.module.grip)
        for i, part in enumerate(structure.parts)
        if part.module.grip is not None
    ]
    places = np.array([_end_of(part) for _, part, _ in gripping]).reshape(-1, len(_GRID), 3)
    return Grips(
        blocks=tuple(i for i, _, _ in gripping),
        tips=places[:, len(_GRID) // 2],
        places=places,
        reach=np.array([grip.reach for _, _, grip in gripping if grip]),
        limits=np.array([(grip.force, grip.moment) for _, _, grip in gripping if grip]).reshape(
            -1, 2
        ),
    )


def distances(points: FloatArray, shapes: Sequence[Shape]) -> FloatArray:
    """Return each shape's distance from the nearest of some points, 0 inside it, (S,), units.

    A cylinder counts as the box around it.

    Args:
        points: (P, 3) in the frame of the shapes.
        shapes: The shapes.
    """
    nearest = np.empty(len(shapes))
    for k, shape in enumerate(shapes):
        local = (points - shape.center) @ shape.rotation
        if shape.kind is ShapeKind.SPHERE:
            away = np.linalg.norm(local, axis=1) - shape.half_extents[0]
        else:
            away = np.linalg.norm(np.maximum(np.abs(local) - shape.half_extents, 0.0), axis=1)
        nearest[k] = max(0.0, float(away.min()))
    return nearest


def _end_of(part: Part) -> FloatArray:
    shape = part.shapes[0]
    across = _GRID * shape.half_extents[:2]
    local = np.column_stack([across, np.full(len(_GRID), shape.half_extents[2])])
    return np.asarray(shape.center + local @ shape.rotation.T)
