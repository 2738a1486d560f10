"""Check that a machine is clear of terrain and cargo at the start."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from buildarena_simulation.errors import MachineNotSimulable
from buildarena_simulation.placement import Start
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.model import FloatArray, Shape, ShapeKind, Structure
from buildarena_simulation.terrain import shape_of

_ALLOWED = 0.05
"""Overlap that the engines treat as contact, units."""

_NO_LENGTH = 1e-9


def require_clear_start(structure: Structure, scenario: Scenario, start: Start) -> None:
    """Refuse a machine whose blocks overlap terrain or cargo where the trial starts.

    Args:
        scenario: Its `clear_start` requires the check.

    Raises:
        MachineNotSimulable: Blocks overlap; names the first block, and with what.
    """
    if not scenario.clear_start:
        return
    boxes = list(_obstacles(scenario, start))
    for part in structure.parts:
        for shape in part.shapes:
            placed = Shape(
                kind=shape.kind,
                center=start.position + start.rotation @ shape.center,
                rotation=start.rotation @ shape.rotation,
                half_extents=shape.half_extents,
            )
            for named, box in boxes:
                if _overlap(placed, box):
                    raise MachineNotSimulable(
                        f"block {part.id} ({part.module.name}) overlaps {named} at the start"
                    )


def _obstacles(scenario: Scenario, start: Start) -> Iterator[tuple[str, Shape]]:
    for number, terrain in enumerate(scenario.terrain, start=1):
        yield f"terrain {number}", shape_of(terrain)
    if start.cargo is not None:
        # Objects next to a ball in the box around it are next to the ball.
        yield (
            "the cargo",
            replace(start.cargo, is_ball=False).shape(start.cargo.position, start.cargo.rotation),
        )


def _overlap(shape: Shape, box: Shape) -> bool:
    """Check if no plane separates a shape from a box.

    Exact for boxes, and for a round shape next to a face, an edge or a corner of the box.
    """
    offset = shape.center - box.center
    local = box.rotation.T @ offset
    nearest = box.rotation @ np.clip(local, -box.half_extents, box.half_extents)
    edges = [np.cross(a, b) for a in shape.rotation.T for b in box.rotation.T]
    for axis in [*shape.rotation.T, *box.rotation.T, offset - nearest, *edges]:
        length = np.linalg.norm(axis)
        if length < _NO_LENGTH:
            continue
        way = axis / length
        if _radius(shape, way) + _radius(box, way) - abs(offset @ way) < _ALLOWED:
            return False
    return True


def _radius(shape: Shape, way: FloatArray) -> float:
    """Return the extent of a shape from its centre along a direction, units."""
    along = np.abs(shape.rotation.T @ way)
    half = shape.half_extents
    if shape.kind is ShapeKind.BOX:
        return float(along @ half)
    if shape.kind is ShapeKind.CYLINDER:
        return float(half[2] * along[2] + half[0] * np.sqrt(max(0.0, 1.0 - along[2] ** 2)))
    return float(half.max())
