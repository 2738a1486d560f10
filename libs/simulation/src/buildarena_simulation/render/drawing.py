"""Draws pictures of a scene with Pillow: painter's order, flat shading, no graphics card."""

from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_simulation.render.camera import Camera
from buildarena_simulation.render.scene import Color, Picture
from buildarena_simulation.structure.model import FloatArray

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

_SKY: Final[Color] = (226, 233, 239)
_GROUND: Final[Color] = (205, 211, 200)
_GRID: Final[Color] = (176, 184, 172)
_INK: Final[Color] = (30, 34, 40)
_GRID_STEP: Final = 2.0
_GRID_HEIGHT: Final = 16.0
"""Height of the camera above which the grid is wider, units."""
_GRID_REACH: Final = 30
_NEAR: Final = 0.5


def draw(picture: Picture, camera: Camera, *, size: tuple[int, int], caption: str) -> "Image":
    """Draw one frame.

    Args:
        size: Width and height, pixels.
        caption: Lines of text for the upper left corner.
    """
    from PIL import Image, ImageDraw

    image = Image.new("RGB", size, _SKY)
    canvas = ImageDraw.Draw(image)
    _draw_ground(canvas, camera)
    for _, kind, points, color, width in sorted(
        _painted(picture, camera), key=lambda item: -item[0]
    ):
        if kind == "face":
            canvas.polygon(points, fill=color, outline=_darker(color))
        elif kind == "line":
            canvas.line(points, fill=color, width=width)
        else:
            canvas.ellipse(points, fill=color)
    canvas.multiline_text((12, 10), caption, fill=_INK, font_size=max(12, size[1] // 30))
    return image


_Item = tuple[float, str, list[tuple[float, float]], Color, int]
"""Depth, kind, pixels, colour and line width of a thing to paint."""


def _painted(picture: Picture, camera: Camera) -> list[_Item]:
    items: list[_Item] = []
    for corners, color in picture.faces:
        pixels, depth = camera.project(corners)
        if depth.min() < _NEAR or _signed_area(pixels) >= 0.0:
            continue
        items.append((float(depth.mean()), "face", _points(pixels), color, 0))
    for ends, color in picture.lines:
        pixels, depth = camera.project(ends)
        if depth.min() >= _NEAR:
            width = max(1, round(0.12 * camera.focal / float(depth.mean())))
            # Braces lie on the blocks' faces; drawn slightly nearer, they are painted over them.
            items.append((float(depth.mean()) - 0.6, "line", _points(pixels), color, width))
    for center, radius, color in picture.balls:
        pixels, depth = camera.project(center[None])
        if depth[0] >= _NEAR:
            r = radius * camera.focal / float(depth[0])
            (x, y), *_ = _points(pixels)
            items.append(
                (float(depth[0]) - 0.6, "ball", [(x - r, y - r), (x + r, y + r)], color, 0)
            )
    return items


def _draw_ground(canvas: "ImageDraw", camera: Camera) -> None:
    """Draw the plane z = 0 below the horizon, with a grid round the camera's target."""
    width, height = camera.center * 2
    down = camera.axes[2]
    if down[2] > 0:
        horizon = camera.center[1] - camera.focal * np.tan(np.arcsin(down[2]))
        canvas.rectangle([0, max(0.0, horizon), width, height], fill=_GROUND)
    target = camera.position - down * (camera.position[2] / max(down[2], 0.05))
    wider = max(0, round(np.log2(max(camera.position[2], 1.0) / _GRID_HEIGHT)))
    step = _GRID_STEP * 2.0**wider
    middle = np.round(target[:2] / step) * step
    reach = _GRID_REACH * step
    for k in range(-_GRID_REACH, _GRID_REACH + 1):
        offset = k * step
        for start, end in (
            ([middle[0] + offset, middle[1] - reach], [middle[0] + offset, middle[1] + reach]),
            ([middle[0] - reach, middle[1] + offset], [middle[0] + reach, middle[1] + offset]),
        ):
            _draw_segment(canvas, camera, np.array([[*start, 0.0], [*end, 0.0]]))


def _draw_segment(canvas: "ImageDraw", camera: Camera, ends: FloatArray) -> None:
    """Draw a line on the ground, cut off where it passes behind the camera."""
    depth = -((ends - camera.position) @ camera.axes[2])
    if depth.max() <= _NEAR:
        return
    if depth.min() < _NEAR:
        share = (depth.max() - _NEAR) / (depth.max() - depth.min())
        back, front = ends[np.argmax(depth)], ends[np.argmin(depth)]
        ends = np.array([back, back + share * (front - back)])
    pixels, _ = camera.project(ends)
    canvas.line(_points(pixels), fill=_GRID, width=1)


def _signed_area(pixels: FloatArray) -> float:
    x, y = pixels[:, 0], pixels[:, 1]
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def _points(pixels: FloatArray) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in pixels]


def _darker(color: Color) -> Color:
    red, green, blue = (round(channel * 0.72) for channel in color)
    return red, green, blue
