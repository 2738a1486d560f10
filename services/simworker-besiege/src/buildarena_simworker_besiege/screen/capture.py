"""Pictures of a screen, and how much they differ."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from PIL.Image import Image

    from buildarena_simworker_besiege.screen.windows import Area

_VISIBLE: Final = 16
"""Shades of grey, of 256, by which a pixel must change to count."""


def picture(area: Area) -> Image:
    """A part of the screen, in shades of grey."""
    from PIL import ImageGrab

    return ImageGrab.grab(bbox=area.box).convert("L")


def screenshot() -> bytes:
    """The whole screen as PNG."""
    from PIL import ImageGrab

    data = io.BytesIO()
    ImageGrab.grab().save(data, "PNG")
    return data.getvalue()


def difference(first: Image, second: Image) -> float:
    """Share of two pictures that looks different, 0 to 1."""
    from PIL import ImageChops

    if first.size != second.size:
        return 1.0
    small = (256, 256)
    changed = ImageChops.difference(first.resize(small), second.resize(small))
    counts = changed.histogram()
    return sum(counts[_VISIBLE:]) / (small[0] * small[1])
