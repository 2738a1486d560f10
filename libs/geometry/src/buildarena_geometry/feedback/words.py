"""Numbers, directions and turning in words."""

import math
from collections.abc import Iterable

from buildarena_geometry.rotations import Vector, cross

DOWN = (0.0, 0.0, -1.0)
AXIS_TOLERANCE_DEG = 1e-6  # nearer than this to an axis of the world, a direction is that axis
ROLLING_TILT_DEG = 60.0  # a wheel whose axle is tilted more than this lies too flat to roll

_CARDINALS = ("North", "East", "South", "West")
_QUADRANTS = ("Northeast", "Southeast", "Southwest", "Northwest")


def number(value: float, decimals: int = 2) -> str:
    """Format a number with at most `decimals` decimals: "1.25", "-3", "0"."""
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in {"-0", ""} else text


def point(vector: Vector, decimals: int = 2) -> str:
    """Format a position or offset, east, north, up: "[1, 0, -0.5]"."""
    return f"[{', '.join(number(value, decimals) for value in vector)}]"


def plain(value: float) -> str:
    """Format a number with as few digits as represent it: "3.65", "2"."""
    return f"{value + 0.0:.6g}"


def caption(direction: Vector) -> str:
    """Format a direction as an azimuth from north through east and a pitch above the horizon.

    Args:
        direction: unit length, world frame.

    Returns:
        "<North>", "<Southeast 146.3°>", "<North with 12.0° pitch>", "<Up>" or "<Down>".
    """
    east, north, up = direction
    across = math.hypot(east, north)
    pitch = math.degrees(math.atan2(up, across))
    if abs(pitch) > 90 - AXIS_TOLERANCE_DEG:
        return "<Up>" if up > 0 else "<Down>"
    bearing = _bearing(math.degrees(math.atan2(east, north)) % 360)
    if abs(pitch) < AXIS_TOLERANCE_DEG:
        return f"<{bearing}>"
    return f"<{bearing} with {number(pitch, 1)}° pitch>"


def listing(names: Iterable[str]) -> str:
    """Join words with commas, or return "none"."""
    return ", ".join(names) or "none"


def counted(amount: int, word: str) -> str:
    """Format an amount with its word: "1 block", "2 blocks"."""
    return f"{amount} {word}" if amount == 1 else f"{amount} {word}s"


def rolling(axle: Vector, *, clockwise: bool) -> str:
    """Describe a wheel's motion while its forward key is held.

    Args:
        axle: outward normal of the wheel's outer face, world frame, unit length.
        clockwise: true if it then turns clockwise seen from outside.

    Returns:
        The way it rolls and its camber, or, where it lies too flat to roll, the way it spins.
    """
    tilt = math.degrees(math.asin(max(-1.0, min(1.0, axle[2]))))
    if abs(tilt) >= ROLLING_TILT_DEG:
        # From above, a wheel that faces up is seen from outside.
        sense = "clockwise" if (axle[2] > 0) == clockwise else "counterclockwise"
        return f"too flat to roll, forward spins it {sense} seen from above"
    x, y, _ = cross(axle, DOWN)
    sign = (1.0 if clockwise else -1.0) / math.hypot(x, y)
    camber = "" if abs(tilt) < AXIS_TOLERANCE_DEG else f", camber {number(tilt, 1)}°"
    return f"forward rolls it {caption((x * sign, y * sign, 0.0))}{camber}"


def _bearing(azimuth: float) -> str:
    quarter = round(azimuth / 90)
    if abs(azimuth - 90 * quarter) < AXIS_TOLERANCE_DEG:
        return _CARDINALS[quarter % 4]
    return f"{_QUADRANTS[int(azimuth // 90) % 4]} {number(azimuth, 1)}°"
