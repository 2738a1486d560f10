"""How the wheels of one rigid body share its weight: by statics, as wheels that yield alike.

Statics leaves open how four points under a rigid body bear it, and a solver by iteration takes any
solution. Wheels that yield alike bear what a plane over the places where they stand says.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

_LINE: Final = 1e-6
"""Wheels in a line bear no moment about it; this share of their spread keeps that solvable."""

Vector = tuple[float, float, float]


@dataclass(slots=True, kw_only=True)
class Wheel:
    """A powered wheel and what it stands on.

    Attributes:
        cluster: Its cluster.
        parent: The cluster that it hangs on.
        mass: Of its whole component, mass units.
        friction: Its coefficient.
        slips: Whether its friction is ours.
        load: What it bears, mass·unit/s²; 0 where it does not stand on ground or terrain alone.
        pressed: Where the resultant of its contacts acts, world frame, units.
        point: Where it stands, below its middle, world frame, units.
        arm: From its centre of mass to there, world frame, units.
        normal: Of what it stands on, world frame.
        surface: The fixed body that it stands on.
        force: Friction on it, world frame, mass·unit/s².
    """

    cluster: int
    parent: int
    mass: float
    friction: float
    slips: bool = False
    load: float = 0.0
    pressed: Vector = (0.0, 0.0, 0.0)
    point: Vector = (0.0, 0.0, 0.0)
    arm: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    surface: int = -1
    force: Vector = (0.0, 0.0, 0.0)


def mean_of(points: Sequence[Vector], weights: Sequence[float]) -> Vector:
    """The weighted mean of some points; the weights have a sum above 0."""
    whole, x, y, z = 0.0, 0.0, 0.0, 0.0
    for (px, py, pz), weight in zip(points, weights, strict=True):
        whole += weight
        x, y, z = x + weight * px, y + weight * py, z + weight * pz
    return x / whole, y / whole, z / whole


def share(wheels: Sequence[Wheel]) -> None:
    """Spreads the load of wheels on one rigid body as if they yielded alike.

    With places x and y their loads become a + b·x + c·y, with the resultant and the moments that
    they had; wheels that would have to pull bear nothing.

    Args:
        wheels: The wheels; their loads are changed in place.
    """
    whole = sum(wheel.load for wheel in wheels)
    if whole == 0.0:
        return
    x, y, _ = mean_of([w.pressed for w in wheels], [w.load for w in wheels])
    bearing = list(wheels)
    while True:
        loads = _plane(bearing, whole, x, y)
        lowest = min(loads)
        if lowest >= 0.0 or len(bearing) == 1:
            break
        bearing[loads.index(lowest)].load = 0.0
        del bearing[loads.index(lowest)]
    for wheel, load in zip(bearing, loads, strict=True):
        wheel.load = load


def _plane(wheels: Sequence[Wheel], whole: float, x: float, y: float) -> list[float]:
    """Loads with the sum `whole` and their centre at (x, y)."""
    count = len(wheels)
    cx = sum(wheel.point[0] for wheel in wheels) / count
    cy = sum(wheel.point[1] for wheel in wheels) / count
    apart = [(wheel.point[0] - cx, wheel.point[1] - cy) for wheel in wheels]
    xx, yy = sum(dx * dx for dx, _ in apart), sum(dy * dy for _, dy in apart)
    xy = sum(dx * dy for dx, dy in apart)
    slack = _LINE * (xx + yy + 1.0)
    xx, yy = xx + slack, yy + slack
    mx, my = whole * (x - cx), whole * (y - cy)
    free = xx * yy - xy * xy
    b, c = (mx * yy - my * xy) / free, (my * xx - mx * xy) / free
    return [whole / count + b * dx + c * dy for dx, dy in apart]
