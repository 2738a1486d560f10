"""Rotations as builders name them."""

from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Quaternion, Vector, about_axis, multiply, subtract

_EAST, _NORTH, _UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def turned(yaw_pitch_roll_deg: Vector) -> Quaternion:
    """The rotation of a whole machine.

    Args:
        yaw_pitch_roll_deg: degrees; yaw turns north to east, pitch north down, roll up to east.
            Roll acts first, then yaw, then pitch, each about the world's axes.

    Returns:
        The rotation in the world frame, a unit quaternion.
    """
    yaw, pitch, roll = yaw_pitch_roll_deg
    first = multiply(about_axis(_UP, -yaw), about_axis(_NORTH, roll))
    return multiply(about_axis(_EAST, -pitch), first)


def turn_about(center: Vector, rotation: Quaternion) -> Pose:
    """The rigid motion that turns the world about a point."""
    turn = Pose(quaternion=rotation)
    return Pose(position=subtract(center, turn.point(center)), quaternion=rotation)
