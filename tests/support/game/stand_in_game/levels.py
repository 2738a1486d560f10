"""The level that is open: its boxes, and how high the ground is at a place.

A box's origin is the middle of its underside, as the level files of the published runner suggest.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """A fixed box: the middle of its underside, its edges' directions, its size."""

    origin: Vector
    axes: tuple[Vector, Vector, Vector]
    size: Vector

    def top(self, east: float, north: float) -> float | None:
        """Where a line from above meets it; None if it misses."""
        low, high = -math.inf, math.inf
        away = (east - self.origin[0], -self.origin[1], north - self.origin[2])
        bounds = [(-self.size[0] / 2, self.size[0] / 2), (0.0, self.size[1])]
        bounds.append((-self.size[2] / 2, self.size[2] / 2))
        for axis, (least, most) in zip(self.axes, bounds, strict=True):
            start = sum(a * b for a, b in zip(axis, away, strict=True))
            if abs(axis[1]) < 1e-9:
                if not least <= start <= most:
                    return None
                continue
            ends = sorted(((least - start) / axis[1], (most - start) / axis[1]))
            low, high = max(low, ends[0]), min(high, ends[1])
        return high if low <= high else None


class Level:
    """What is open: the flat sandbox, or a level file's boxes on its ground."""

    def __init__(self, file: str | None) -> None:
        objects = ET.fromstring(Path(file).read_bytes()).iter("Object") if file else ()
        self.boxes = [_box(entry) for entry in objects if entry.get("Prefab") == "7000"]

    def ground(self, east: float, north: float) -> float:
        """The height at which a ray from above ends."""
        tops = [box.top(east, north) for box in self.boxes]
        return max((top for top in tops if top is not None), default=0.0)


def _box(entry: ET.Element) -> Box:
    turn = entry.find("Rotation")
    x, y, z, w = (float(turn.get(name, 0)) for name in "xyzw") if turn is not None else (0, 0, 0, 1)
    axes = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )
    return Box(_vector(entry.find("Position")), axes, _vector(entry.find("Scale")))


def _vector(entry: ET.Element | None) -> Vector:
    assert entry is not None
    x, y, z = (float(entry.get(name, 0)) for name in "xyz")
    return (x, y, z)
