"""A module's motion on the face it sits on, its drive, and cogs.

Its freedom follows from its joint type: it turns on an axle or a hinge, slides on a
slider, turns about all three axes in a ball, and swings without twist in a constant-velocity joint.
"""

import math
from typing import Literal

from msgspec.structs import replace

from buildarena_geometry.rotations import Vector
from buildarena_geometry.struct_reader import Amount, Finite, Point, Positive, Sourced, refuse

MOVING_JOINTS = ("axle", "hinge", "slider", "ball", "constant_velocity")
Sense = Literal["clockwise", "counterclockwise"]
UP: Vector = (0.0, 0.0, 1.0)
MESH_SLACK = 0.1
"""Cogs mesh if the distance of their axes misses the sum of their pitch radii by no more, units.
Chosen: a fifth of the shift that a builder is allowed."""
MESH_COSINE = 0.996
"""Cosine of the greatest angle between the axes of cogs that mesh. Chosen: five degrees."""

_DRIVEN = ("axle", "hinge", "slider")
_LIMITED = ("hinge", "slider", "constant_velocity")
_TWISTLESS = 150.0  # degrees; a constant-velocity joint bent right back has no axis left


class Drive(Sourced, frozen=True, kw_only=True):
    """Servo that controls a joint's speed or position.

    Attributes:
        kind: controlled quantity: a speed, or a position that its keys move.
        rate: its speed, or that of the position its keys move, rad/s; of a slider units/s.
        force: the most it exerts, mass·g·unit; of a slider mass·g.
        forward: the action towards larger angles or away from the base; None if keys do not.
        backward: action for the opposite direction, if any.
        default_mode: behaviour without a key: hold the position, turn freely, return to 0, or
            always run forward.
        lag_per_s: rate of the first-order lag with which a speed follows its keys, 1/s.
        forward_sense: sense of forward, seen against its axis, until its spin is flipped; None for
            one that cannot be flipped, whose forward is counterclockwise.
    """

    kind: Literal["speed", "position"]
    rate: Positive
    force: Positive
    forward: str | None = None
    backward: str | None = None
    default_mode: Literal["hold", "free", "return", "forward"] = "hold"
    lag_per_s: Positive = 16.0
    forward_sense: Sense | None = None


class MovingJoint(Sourced, frozen=True, kw_only=True):
    """Freedom of a block on the block it sits on.

    Angles are in radians, degrees in module files, and counted from how it was built,
    counterclockwise seen against the axis.

    Attributes:
        axis: (3,) axis that it turns about or slides along, block frame, unit length; of a
            constant-velocity joint its shaft; meaningless for a ball.
        point: (3,) a point of the axis, or the middle of a ball, block frame, units; None for the
            middle of its body.
        limits: smallest and largest angle, or shift in units; None if unlimited.
        friction: moment that dry friction takes, mass·g·unit; of a slider the force, mass·g.
        stiffness: of the spring that draws it to 0, mass·g·unit/rad; of a slider mass·g/unit.
        damping: of the damper parallel to the spring, mass·g·unit·s/rad; of a slider mass·g·s/unit.
    """

    axis: Point = UP
    point: Point | None = None
    limits: tuple[Finite, Finite] | None = None
    friction: Amount = 0.0
    stiffness: Amount = 0.0
    damping: Amount = 0.0
    drive: Drive | None = None


class Gear(Sourced, frozen=True, kw_only=True):
    """The teeth of a cog.

    Attributes:
        pitch_radius: of the circle that rolls on another cog's, units.
    """

    pitch_radius: Positive


def checked_joint(joint: MovingJoint, joint_type: str | None) -> MovingJoint:
    """Return the joint of a module file's entry with its degrees converted to radians.

    Args:
        joint: joint as in the file.
        joint_type: attachment of the module.

    Raises:
        FieldError: it contradicts this joint type.
    """
    if joint_type not in MOVING_JOINTS:
        moving = ", ".join(MOVING_JOINTS)
        refuse("joint", f"no joint: only one of the joint types {moving} moves", joint_type)
    sprung = bool(joint.stiffness or joint.damping)
    if joint.drive is not None:
        if joint_type not in _DRIVEN or sprung or joint.friction:
            moved = f"it moves one of the joint types {', '.join(_DRIVEN)}"
            alone = f"no drive: {moved} without a spring, a damper or friction"
            refuse("joint.drive", alone, joint.drive)
        _check_drive(joint.drive, joint_type)
    if sprung and (joint_type not in ("hinge", "slider") or joint.friction):
        only = "only a hinge or slider without friction has them"
        refuse("joint", f"no spring and no damper: {only}", joint_type)
    if joint.limits is not None:
        _check_limits(joint.limits, joint_type)
    return joint if joint_type == "slider" else _in_radians(joint)


def _check_limits(limits: tuple[float, float], joint_type: str) -> None:
    low, high = limits
    if joint_type not in _LIMITED:
        expected = f"no limits: one of the joint types {', '.join(_LIMITED)} has them"
    elif not low <= 0.0 <= high or low == high:
        expected = "two numbers, the first at most 0, the second at least 0 and larger"
    elif joint_type == "hinge" and not (low > -180.0 and high < 180.0):  # noqa: PLR2004 - half a turn
        expected = "two angles between -180 and 180 degrees"
    elif joint_type == "constant_velocity" and not (-low == high <= _TWISTLESS):
        expected = f"two opposite angles up to {_TWISTLESS:g} degrees"
    else:
        return
    refuse("joint.limits", expected, limits)


def _check_drive(drive: Drive, joint_type: str) -> None:
    mode = drive.default_mode
    if drive.kind == "position" and mode in ("free", "forward"):
        expected = "hold or return: a drive that holds a place does nothing else"
        refuse("joint.drive.default_mode", expected, mode)
    if drive.kind == "speed" and mode == "return":
        expected = "hold, free or forward: a drive that holds a speed knows no place"
        refuse("joint.drive.default_mode", expected, mode)
    if (drive.forward is None) != (mode == "forward"):
        expected = "an action, or none where it runs forward all the time"
        refuse("joint.drive.forward", expected, drive.forward)
    if drive.forward_sense is not None and joint_type == "slider":
        expected = "no sense: a slider does not turn"
        refuse("joint.drive.forward_sense", expected, drive.forward_sense)


def _in_radians(joint: MovingJoint) -> MovingJoint:
    limits, drive = joint.limits, joint.drive
    return replace(
        joint,
        limits=limits and (math.radians(limits[0]), math.radians(limits[1])),
        drive=drive and replace(drive, rate=math.radians(drive.rate)),
    )
