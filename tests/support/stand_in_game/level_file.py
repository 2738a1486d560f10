"""Reads level files (.blv): the fixed boxes a level is made of."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from buildarena_simulation.scenario import TerrainBox
from stand_in_game.frames import rotated
from stand_in_game.machine_file import (
    GameFileError,
    child,
    parsed,
    rotation_of,
    vector_of,
)

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_BOX: Final = "7000"
_START: Final = "9001"
_STRAIGHT: Final = 1e-6


def read_level_file(path: Path) -> tuple[TerrainBox, ...]:
    """The boxes of a level, world frame (x east, y north, z up).

    A box's origin is the middle of its underside.

    Raises:
        GameFileError: the file is no level, or holds what the stand-in does not know.
        OSError: it cannot be read.
    """
    objects = child(parsed(path.read_bytes(), "Level"), "Objects")
    boxes = []
    for element in objects:
        prefab = element.get("Prefab")
        if prefab == _BOX:
            boxes.append(_box(element))
        elif prefab != _START:
            raise GameFileError(f"Object: Prefab {prefab} is not known; known: {_BOX}, {_START}")
    return tuple(boxes)


def _box(element: Element) -> TerrainBox:
    x, y, z = vector_of(child(element, "Position"))
    width, height, length = vector_of(child(element, "Scale"))
    turn = element.find("Rotation")
    rotation = (0.0, 0.0, 0.0, 1.0) if turn is None else rotation_of(turn)
    east, _, _ = (rotated(rotation, axis) for axis in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)))
    if abs(east[0] - 1.0) > _STRAIGHT:
        raise GameFileError(f"Object {element.get('ID')}: turned other than about the east axis")
    north = rotated(rotation, (0.0, 0.0, 1.0))
    dx, dy, dz = rotated(rotation, (0.0, height / 2, 0.0))
    return TerrainBox(
        center=(x + dx, z + dz, y + dy),
        size=(width, length, height),
        slope_deg=math.degrees(math.atan2(north[1], north[2])),
    )
