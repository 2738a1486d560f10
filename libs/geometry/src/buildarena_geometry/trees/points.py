"""Building points: how construction trees number a module's faces, and how blocks are turned.

BesiegeField names the sides of a block as somebody sees them who looks the way it points: front,
back, left, right, up, down. How a block is turned depends on nothing but where it points: upright
where that is level, and otherwise with its right to the east.

Source: the block tables and the placing of blocks of BesiegeField's public release. Its 43 types
number their points by the order that `points_of` has; types that it lacks get the same order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from buildarena_geometry.besiege_components import besiege_offset, besiege_point
from buildarena_geometry.feedback.words import point

if TYPE_CHECKING:
    from collections.abc import Iterable

    from buildarena_geometry.modules.module import Face, Module
    from buildarena_geometry.rotations import Vector

SIDES: Final = ("front", "back", "left", "right", "up", "down")
POINTING: Final = {
    "north": ("west", "east", "up", "down"),
    "south": ("east", "west", "up", "down"),
    "east": ("north", "south", "up", "down"),
    "west": ("south", "north", "up", "down"),
    "up": ("west", "east", "south", "north"),
    "down": ("west", "east", "north", "south"),
}
"""Where left, right, up and down of a block are that points some way."""
_DIGITS: Final = 6
_LARGEST_FLIPPED: Final = -1.0 + 1e-9


def points_of(module: Module) -> tuple[Face, ...]:
    """A module's faces in the order of their building points; the face it sits by has none.

    They are ordered by side, on one side by the distance from the base, then from the middle.
    """
    faces = [face for face in module.faces if face.label != module.root_face]
    return tuple(sorted(faces, key=lambda face: _place(module, face)))


def point_text(module: Module, number: int) -> str:
    """A building point in words: its number, its side and where it is.

    Returns:
        Such as "1 left [-0.5, 0, 0.5]": [right, up, ahead] from where the block touches its parent,
        units; a starting block's from its centre.
    """
    face = points_of(module)[number]
    side = SIDES[_side(_seen(module, face.normal))]
    return f"{number} {side} {point(_seen(module, face.center))}"


def points_text(modules: Iterable[Module]) -> str:
    """What writers of trees read: the building points of modules, and where their sides are."""
    holders: dict[str, list[str]] = {}
    for module in modules:
        numbers = range(len(points_of(module)))
        points = ", ".join(point_text(module, number) for number in numbers) or "none"
        if module.kind == "connector":
            points = "joins two points"
        holders.setdefault(points, []).append(f"{module.name} ({module.besiege_id})")
    rows = [f"- {', '.join(names)}: {points}" for points, names in holders.items()]
    pointing = [f"- {where}: {', '.join(sides)}" for where, sides in POINTING.items()]
    head = (
        "Modules with their numbers, and each point with its number, its side and its place "
        "[right, up, ahead], from where the block sits; the starting block's from its centre. In "
        "data lines x of a block is its left, y up and z ahead; letters of faces are not used here."
    )
    sides = "\nWhere left, right, up and down are of a block that points"
    return "\n".join([head, *rows, sides, *pointing])


def turned_x_axis(normal: Vector) -> Vector:
    """The x axis that a construction tree gives a block, as our frames have it.

    Args:
        normal: where it points, world frame, unit length.

    Returns:
        World frame, unit length: opposite to the block's right, as the game's frames are
        left-handed.
    """
    east, up, north = besiege_point(normal)
    if north < _LARGEST_FLIPPED:
        right = (-1.0, 0.0, 0.0)
    else:
        # The shortest turn that takes north to the normal takes east to this.
        right = (1.0 - east * east / (1.0 + north), -east * up / (1.0 + north), -east)
    x, y, z = besiege_point(right)
    return (-x, -y, -z)


def _place(module: Module, face: Face) -> tuple[float, ...]:
    right, up, ahead = (round(value, _DIGITS) for value in _seen(module, face.center))
    side = _side(_seen(module, face.normal))
    middle = max(abs(right), abs(up)) if side in {0, 1} else 0.0
    around = _side((right, up, 0.0)) if middle else 0
    return (side, ahead, middle, around, right, up)


def _seen(module: Module, inner: Vector) -> Vector:
    """A vector of a block's frame as [right, up, ahead]."""
    return besiege_point(inner) if module.kind == "start" else besiege_offset(inner)


def _side(vector: Vector) -> int:
    """Which of the six sides a vector points to, most of all."""
    right, up, ahead = vector
    sizes = (abs(ahead), abs(right), abs(up))
    axis = sizes.index(max(sizes))
    ahead_or_back = 0 if ahead > 0 else 1
    left_or_right = 2 if right < 0 else 3
    up_or_down = 4 if up > 0 else 5
    return (ahead_or_back, left_or_right, up_or_down)[axis]
