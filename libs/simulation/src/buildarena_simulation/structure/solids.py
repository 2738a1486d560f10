"""The collision shapes of clusters: boxes that form one flat face are one box.

A deck of a hundred blocks is a few slabs to an engine: fewer contacts, and none on the seams.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Final

import numpy as np

from buildarena_simulation.constants import COLLISION_MARGIN
from buildarena_simulation.structure.model import FloatArray, Part, Shape, ShapeKind, Structure

_GRAIN: Final = 1e-5
"""Distance below which faces are one plane, units."""

_Box = tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, ...]]
"""Lower and upper corner in grains, and the blocks inside."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A convex collision shape of one cluster, as an engine builds it.

    Attributes:
        center: (3,) machine frame, units.
        rotation: (3, 3) machine_from_solid; a cylinder's axis is the third column.
        half_extents: (3,) as in `Shape`, a box's less the collision margin, units.
        blocks: The blocks it represents.
        friction: Coefficient of its surface.
        is_wheel: True for a wheel's.
    """

    kind: ShapeKind
    center: FloatArray
    rotation: FloatArray
    half_extents: FloatArray
    blocks: tuple[int, ...]
    friction: float
    is_wheel: bool


class Solids:
    """Cached solids of sets of clusters; those of an unchanged cluster are computed once."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._known: dict[tuple[int, ...], tuple[Solid, ...]] = {}

    def of(self, blocks: Iterable[int]) -> tuple[Solid, ...]:
        """Return the solids of one cluster.

        Args:
            blocks: Indices of its blocks, ascending.
        """
        key = tuple(int(i) for i in blocks)
        if key not in self._known:
            self._known[key] = tuple(_solids(self._structure, key))
        return self._known[key]


def collision_half_extents(shape: Shape) -> FloatArray:
    """Return a shape's half-extents in an engine: a box's less the margin, (3,), units."""
    margin = COLLISION_MARGIN if shape.kind is ShapeKind.BOX else 0.0
    return np.asarray(shape.half_extents - margin)


def _solids(structure: Structure, blocks: Sequence[int]) -> Iterator[Solid]:
    groups: list[tuple[FloatArray, float, list[int]]] = []
    for i in blocks:
        part = structure.parts[i]
        if not _merges(part):
            yield from _own_solids(i, part)
            continue
        turn, friction = part.shapes[0].rotation, part.physics.friction
        for frame, coefficient, inside in groups:
            if coefficient == friction and _is_lattice_turn(frame.T @ turn):
                inside.append(i)
                break
        else:
            groups.append((turn, friction, [i]))
    for frame, friction, inside in groups:
        for low, high, merged in _merged([_box(structure, i, frame) for i in inside]):
            lower, upper = np.array(low) * _GRAIN, np.array(high) * _GRAIN
            yield Solid(
                kind=ShapeKind.BOX,
                center=frame @ ((lower + upper) / 2),
                rotation=frame,
                half_extents=(upper - lower) / 2 - COLLISION_MARGIN,
                blocks=merged,
                friction=friction,
                is_wheel=False,
            )


def _merges(part: Part) -> bool:
    return part.physics.structural and [s.kind for s in part.shapes] == [ShapeKind.BOX]


def _own_solids(block: int, part: Part) -> Iterator[Solid]:
    for shape in part.shapes:
        yield Solid(
            kind=shape.kind,
            center=shape.center,
            rotation=shape.rotation,
            half_extents=collision_half_extents(shape),
            blocks=(block,),
            friction=part.physics.friction,
            is_wheel=part.is_wheel,
        )


def _is_lattice_turn(rotation: FloatArray) -> bool:
    """Check if a rotation maps axes to axes."""
    return bool(np.abs(np.abs(rotation) - np.round(np.abs(rotation))).max() < _GRAIN)


def _box(structure: Structure, block: int, frame: FloatArray) -> _Box:
    shape = structure.parts[block].shapes[0]
    center = frame.T @ shape.center
    half = np.abs(frame.T @ shape.rotation) @ shape.half_extents
    low, high = (np.round(v / _GRAIN).astype(int).tolist() for v in (center - half, center + half))
    return (tuple(low), tuple(high), (block,))


def _merged(boxes: Sequence[_Box]) -> list[_Box]:
    """Join boxes along the axes, in the order that leaves the fewest."""
    best = list(boxes)
    for order in permutations(range(3)):
        merged = list(boxes)
        for axis in order:
            merged = _joined(merged, axis)
        if len(merged) < len(best):
            best = merged
    return best


def _joined(boxes: Sequence[_Box], axis: int) -> list[_Box]:
    """Merge boxes of equal section that touch along an axis."""
    a, b = (other for other in range(3) if other != axis)
    order = sorted(
        boxes, key=lambda box: (box[0][a], box[1][a], box[0][b], box[1][b], box[0][axis])
    )
    joined: list[_Box] = []
    for low, high, blocks in order:
        if joined:
            before_low, before_high, before = joined[-1]
            same = all(before_low[k] == low[k] and before_high[k] == high[k] for k in (a, b))
            if same and before_high[axis] == low[axis]:
                joined[-1] = (before_low, high, (*before, *blocks))
                continue
        joined.append((low, high, blocks))
    return joined
