"""Pictures of a screen, and how much they differ."""

from __future__ import annotations

import io
from typing import Final

from PIL.Image import Image

from buildarena_simworker.besiege.errors import ScreenError
from buildarena_simworker.besiege.screen.window_types import Area

_VISIBLE: Final = 16
"""Minimum change of a pixel that counts, in shades of grey of 256."""


def picture(area: Area) -> Image:
    """Return a part of the screen, in shades of grey."""
    return _grabbed(area.box).convert("L")


def screenshot() -> bytes:
    """Return the whole screen as PNG; raise `ScreenError` if there is none."""
    data = io.BytesIO()
    _grabbed(None).save(data, "PNG")
    return data.getvalue()


def is_black(image: Image) -> bool:
    """Check if nothing is visible, as while the screen is locked or asleep."""
    return not any(image.convert("L").histogram()[_VISIBLE:])


def _grabbed(box: tuple[int, int, int, int] | None) -> Image:
    """Return the screen, or a part of it.

    Raises:
        ScreenError: The system returns no picture, as while the screen is locked.
    """
    from PIL import ImageGrab

    try:
        return ImageGrab.grab(bbox=box)
    except OSError as error:
        raise ScreenError(f"the screen shows nothing, as while it is locked: {error}") from error


def difference(first: Image, second: Image) -> float:
    """Return the share of two pictures that looks different, 0 to 1."""
    from PIL import ImageChops

    if first.size != second.size:
        return 1.0
    small = (256, 256)
    changed = ImageChops.difference(first.resize(small), second.resize(small))
    counts = changed.histogram()
    return sum(counts[_VISIBLE:]) / (small[0] * small[1])
