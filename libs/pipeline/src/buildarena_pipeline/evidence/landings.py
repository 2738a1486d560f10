"""When and where something lands: read off the path of its height."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_FALLS: Final = 0.2
"""How far something falls from one sample to the next, at least, before it lands, units."""
_RESTS: Final = 0.15
"""Above the height at the first contact, within which the second one is, units."""
_STOPS: Final = 4
"""Samples within which something that lands is lowest."""
_BOUNCES: Final = 0.1
"""A smaller rise is none, units."""


def landing_figures(
    time_s: Floats, height: Floats, *, lost_below: float
) -> dict[str, float | None]:
    """When and where something lands, bounces, lands again and falls through.

    Args:
        time_s: (T,) seconds.
        height: (T,) units.
        lost_below: Below this height it fell through, units.

    Returns:
        Seconds and units; None for what does not happen.
    """
    steps = np.diff(height)
    lost = np.flatnonzero(height < lost_below)
    crossing = float(time_s[lost[0]]) if len(lost) else None
    carried = len(height) if crossing is None else int(lost[0])
    stopped = np.flatnonzero((steps[:-1] < -_FALLS) & (steps[1:] > 0.5 * steps[:-1])) + 1
    figures: dict[str, float | None] = dict.fromkeys(("contact_s", "peak", "peak_s", "again_s"))
    if len(stopped) and stopped[0] < carried:
        first = int(stopped[0])
        figures["contact_s"] = float(time_s[first])
        low = first + int(height[first : first + _STOPS].argmin())
        falls = np.flatnonzero(steps[low:] < 0)
        top = low + int(falls[0]) if len(falls) else len(height) - 1
        if height[top] - height[low] > _BOUNCES:
            back = np.flatnonzero(height[top:] < height[low] + _RESTS)
            figures |= {"peak": float(height[top]), "peak_s": float(time_s[top])}
            figures["again_s"] = float(time_s[top + back[0]]) if len(back) else None
    return {key: _two(value) for key, value in figures.items()} | {"crossing_s": _two(crossing)}


def _two(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
