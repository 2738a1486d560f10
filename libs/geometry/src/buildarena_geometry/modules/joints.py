"""How a module moves on the face it sits on, what drives it there, and cogs.

Which way it is free follows from its seat: it turns on an axle or a hinge, slides on a slider,
turns about all three axes in a ball, and swings without twist in a constant-velocity joint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast, get_args

from buildarena_geometry.rotations import Vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from buildarena_geometry.reading import Fields, Reader

MOVING_SEATS = ("axle", "hinge", "slider", "ball", "constant_velocity")
DriveKind = Literal["speed", "position"]
DRIVE_KINDS: tuple[str, ...] = get_args(DriveKind)
Idle = Literal["hold", "free", "return", "forward"]
IDLES: tuple[str, ...] = get_args(Idle)
Sense = Literal["clockwise", "counterclockwise"]
SENSES: tuple[str, ...] = get_args(Sense)
UP: Vector = (0.0, 0.0, 1.0)

_JOINT = ("axis", "point", "limits", "friction", "stiffness", "damping", "drive", "origin")
_DRIVE = ("kind", "rate", "force")
_DRIVE_OPTIONAL = ("forward", "backward", "idle", "lag_per_s", "forward_sense", "origin")
_DRIVEN = ("axle", "hinge", "slider")
_LIMITED = ("hinge", "slider", "constant_velocity")
_TWISTLESS = 150.0  # degrees; a constant-velocity joint bent right back has no axis left


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What moves a joint: a servo for its speed or for where it stands.

    Attributes:
        kind: whether it holds a speed, or a place that its keys move.
        rate: its speed, or how fast its keys move the place, rad/s; of a slider units/s.
        force: the most it exerts, mass·g·unit; of a slider mass·g.
        forward: the action towards larger angles or away from the base; None if keys do not.
        backward: the action the other way; None if there is none.
        idle: what it does without a key: holds where it is, turns freely, goes back to 0, or runs
            forward all the time.
        lag_per_s: rate of the first-order lag with which a speed follows its keys, 1/s.
        forward_sense: which way forward is, seen against its axis, until its spin is flipped; None
            for one that cannot be flipped, whose forward is counterclockwise.
        origin: where the figures come from.
    """

    kind: DriveKind
    rate: float
    force: float
    forward: str | None = None
    backward: str | None = None
    idle: Idle = "hold"
    lag_per_s: float = 16.0
    forward_sense: Sense | None = None
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatJoint:
    """How a block moves on the block it sits on.

    Angles are in radians and counted from how it was built, counterclockwise seen against the axis.

    Attributes:
        axis: (3,) what it turns about, or slides along, block frame, unit length; of a
            constant-velocity joint its shaft, of a ball without meaning.
        point: (3,) a point of the axis, or the middle of a ball, block frame, units; None for the
            middle of its body.
        limits: the smallest and largest angle, or shift in units; None if nothing stops it.
        friction: moment that dry friction takes, mass·g·unit; of a slider the force, mass·g.
        stiffness: of the spring that draws it to 0, mass·g·unit/rad; of a slider mass·g/unit.
        damping: of the damper beside it, mass·g·unit·s/rad; of a slider mass·g·s/unit.
        drive: what moves it; None if nothing does.
        origin: where the figures come from.
    """

    axis: Vector = UP
    point: Vector | None = None
    limits: tuple[float, float] | None = None
    friction: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    drive: Drive | None = None
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gear:
    """The teeth of a cog.

    Attributes:
        pitch_radius: of the circle that rolls on another cog's, units.
        origin: where the figure comes from.
    """

    pitch_radius: float
    origin: str = ""


def read_joint(entry: Reader, *, seat: str | None, actions: Sequence[str]) -> SeatJoint:
    """The joint of a module file's entry.

    Args:
        entry: the entry's field `joint`.
        seat: what the module sits by.
        actions: what its keys can make it do.

    Raises:
        CatalogueError: it breaks the format, or makes no sense with this seat.
    """
    if seat not in MOVING_SEATS:
        entry.fail(f"no joint: only one of the seats {', '.join(MOVING_SEATS)} moves, not {seat}")
    fields = entry.fields(required=(), optional=_JOINT)
    turns = seat != "slider"
    joint = SeatJoint(
        axis=fields["axis"].direction() if fields.has("axis") else UP,
        point=fields["point"].vector() if fields.has("point") else None,
        limits=_limits(fields["limits"], seat=seat) if fields.has("limits") else None,
        friction=_amount(fields, "friction"),
        stiffness=_amount(fields, "stiffness"),
        damping=_amount(fields, "damping"),
        drive=_drive(fields["drive"], actions, turns=turns) if fields.has("drive") else None,
        origin=fields.text("origin"),
    )
    springs = (joint.stiffness, joint.damping)
    if joint.drive is not None and (seat not in _DRIVEN or any(springs) or joint.friction):
        fields["drive"].fail(
            f"no drive: it moves one of the seats {', '.join(_DRIVEN)}"
            " without a spring, a damper or friction"
        )
    if any(springs) and (seat not in ("hinge", "slider") or joint.friction):
        entry.fail("no spring and no damper: only a hinge or slider without friction has them")
    return joint


def read_gear(entry: Reader, *, seat: str | None) -> Gear:
    """The teeth of a module file's entry; a cog turns on an axle.

    Raises:
        CatalogueError: it breaks the format, or the module's seat is no axle.
    """
    if seat != "axle":
        entry.fail(f"no gear: a cog's seat is axle, not {seat}")
    fields = entry.fields(required=("pitch_radius",), optional=("origin",))
    return Gear(pitch_radius=fields["pitch_radius"].number(above=0), origin=fields.text("origin"))


def _limits(entry: Reader, *, seat: str) -> tuple[float, float]:
    if seat not in _LIMITED:
        entry.fail(f"no limits: one of the seats {', '.join(_LIMITED)} has them")
    low, high = entry.numbers(2)
    if not low <= 0.0 <= high or low == high:
        entry.fail("two numbers, the first at most 0, the second at least 0 and larger")
    if seat == "slider":
        return low, high
    if seat == "hinge" and not (low > -180.0 and high < 180.0):  # noqa: PLR2004 - half a turn
        entry.fail("two angles between -180 and 180 degrees")
    if seat == "constant_velocity" and not (-low == high <= _TWISTLESS):
        entry.fail(f"two opposite angles up to {_TWISTLESS:g} degrees")
    return math.radians(low), math.radians(high)


def _drive(entry: Reader, actions: Sequence[str], *, turns: bool) -> Drive:
    fields = entry.fields(required=_DRIVE, optional=_DRIVE_OPTIONAL)
    kind = cast("DriveKind", fields["kind"].choice(DRIVE_KINDS))
    rate = fields["rate"].number(above=0)
    idle = cast("Idle", fields["idle"].choice(IDLES)) if fields.has("idle") else "hold"
    if kind == "position" and idle in ("free", "forward"):
        fields["idle"].fail("hold or return: a drive that holds a place does nothing else")
    if kind == "speed" and idle == "return":
        fields["idle"].fail("hold, free or forward: a drive that holds a speed knows no place")
    forward = fields["forward"].choice(actions) if fields.has("forward") else None
    if (forward is None) != (idle == "forward"):
        fields["forward"].fail("an action, or none where it runs forward all the time")
    sense = fields["forward_sense"].choice(SENSES) if fields.has("forward_sense") else None
    if sense is not None and not turns:
        fields["forward_sense"].fail("no sense: a slider does not turn")
    lag = fields["lag_per_s"].number(above=0) if fields.has("lag_per_s") else 16.0
    return Drive(
        kind=kind,
        rate=math.radians(rate) if turns else rate,
        force=fields["force"].number(above=0),
        forward=forward,
        backward=fields["backward"].choice(actions) if fields.has("backward") else None,
        idle=idle,
        lag_per_s=lag,
        forward_sense=cast("Sense | None", sense),
        origin=fields.text("origin"),
    )


def _amount(fields: Fields, name: str) -> float:
    return fields[name].number(least=0) if fields.has(name) else 0.0
