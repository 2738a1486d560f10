"""The forces that modules exert by themselves: of nozzles, wings, balloons, springs and others."""

import math
from typing import Annotated, Literal

from msgspec import Meta

from buildarena_geometry.rotations import Vector
from buildarena_geometry.struct_reader import Amount, Finite, Form, Point, Positive, Sourced, refuse

_FASTEST_LOSS = 100.0  # 1/s; a block's faster loss of speed to air is unstable at the time step
_MOST_DAMPING = 3.0  # mass·g per unit/s and mass unit; the same for a held height
_STIFFEST = 1000.0  # mass·g per unit; a stiffer spring between small blocks is unstable
_MOST_SPRING_DAMPING = 10.0  # mass·g per unit/s


class Push(Sourced, frozen=True, kw_only=True):
    """Force along a direction of the block while its key is held.

    Attributes:
        reverse: action that pushes the other way, if any.
        direction: (3,) direction of the force, block frame, unit length.
        force: mass·g.
        needs_air: true if the push decreases with the density of the air.
        fuel: fuel that it burns per second at full push; 0 if it needs none.
        steady_speed: speed at which it brakes its motion about the centre of mass with all
            its push, which reduces the push that keys can request, units/s; None if it does not
            brake.
    """

    action: str
    reverse: str | None = None
    direction: Point
    force: Amount
    needs_air: bool = True
    fuel: Amount = 0.0
    steady_speed: Positive | None = None


class Wing(Sourced, frozen=True, kw_only=True):
    """Force of the air that streams past a block.

    With v the velocity of the block's centre, n the normal and s the normal turned by the pitch,
    the force is -coefficient · (v·s) · min(|v|, cap_speed)^power · n.

    Attributes:
        normal: (3,) the direction of the force, block frame, unit length.
        pitch_deg: angle from the normal to s about the block's z axis, from y towards x, degrees.
        coefficient: force per speed to the power of `power` + 1, mass·unit/s².
        power: further exponent of the speed: 0, 1 or 2.
        cap_speed: speed above which the factor with `power` stops growing, units/s.
        one_sided: true if air that comes from behind, against the normal, exerts no force.
    """

    normal: Point
    pitch_deg: Finite = 0.0
    coefficient: Amount
    power: Literal[0, 1, 2]
    cap_speed: Positive
    one_sided: bool = False

    @property
    def flow(self) -> Vector:
        """(3,) the direction s of the flow that it answers to, block frame, unit length."""
        x, y, z = self.normal
        turn = math.radians(self.pitch_deg)
        cosine, sine = math.cos(turn), math.sin(turn)
        return (x * cosine + y * sine, y * cosine - x * sine, z)


class Lift(Sourced, frozen=True, kw_only=True):
    """Constant upward pull on a block.

    Attributes:
        force: mass·g, before the block's weight is subtracted.
    """

    force: Amount


class Altitude(Sourced, frozen=True, kw_only=True):
    """Lift that holds a block at a height and grows with its distance below that height.

    The lift is stiffness · (target - height) - damping · (rate of climb), from 0 to `most`.

    Attributes:
        most: mass·g.
        stiffness: mass·g per unit.
        damping: mass·g per unit/s.
        rise: action that raises its target.
        sink: action that lowers its target.
        rate: speed of the target, units/s.
    """

    most: Amount
    stiffness: Positive
    damping: Amount
    rise: str
    sink: str
    rate: Positive


class RopeMount(Sourced, frozen=True, kw_only=True):
    """A rope that holds a block to the face it sits on, in place of a joint.

    Attributes:
        length: of the rope when it is taut, units.
    """

    length: Positive


class Spring(Sourced, frozen=True, kw_only=True):
    """Elastic connector, which is neither a strut nor a rope: it pulls and pushes.

    Attributes:
        stiffness: mass·g per unit of extension beyond its length at rest.
        damping: mass·g per unit/s.
        contract: action that shortens its length at rest, if any.
        shortest: shortest length at rest, as a share of its built length.
        rate: speed of the shortening, as a share of its built length, 1/s.
        limit: pull at which it breaks, mass·g.
    """

    stiffness: Annotated[float, Meta(gt=0.0, le=_STIFFEST)]
    damping: Annotated[float, Meta(ge=0.0, le=_MOST_SPRING_DAMPING)]
    contract: str | None = None
    shortest: Annotated[float, Meta(gt=0.0, le=1.0)]
    rate: Positive
    limit: Positive


class Strut(Sourced, frozen=True, kw_only=True):
    """Effect of a rigid connector's length: it weighs more, and buckles (Euler's column).

    It has its module's mass for each unit of its length, and for the first unit if it is shorter.
    Pressed together by more than π² · bending_stiffness / length², it breaks.

    Attributes:
        bending_stiffness: Young's modulus times the section's second moment, mass·g·unit².
    """

    bending_stiffness: Positive


class Decoupling(Sourced, frozen=True, kw_only=True):
    """Single-use release from the face that a block sits on, which pushes the two apart.

    Attributes:
        impulse: impulse on either side, mass·unit/s.
    """

    action: str
    impulse: Amount


class Grip(Sourced, frozen=True, kw_only=True):
    """Hold on the first object that comes near a block's far end.

    Attributes:
        grab: action that makes it ready to hold again after a release.
        reach: distance at which it takes hold of an object, units.
        force: pull at which it releases by itself, mass·g.
        moment: moment at which it releases by itself, mass·g·unit.
    """

    grab: str
    release: str
    reach: Positive
    force: Positive
    moment: Positive


class Tank(Sourced, frozen=True, kw_only=True):
    """Fuel that a block holds, and shares with those that it touches and that take fuel as well.

    Attributes:
        fuel: amount when full; 0 for a block that passes fuel on and holds none.
        mass: mass of that fuel, part of the block's mass, mass units.
    """

    fuel: Amount
    mass: Amount = 0.0


class Flywheel(Sourced, frozen=True, kw_only=True):
    """A wheel inside a block, whose spinning up turns the block the other way.

    Without a key it brakes the block's turning about its axis.

    Attributes:
        left: action that turns the block counterclockwise, seen against its axis.
        right: action that turns it clockwise.
        axis: (3,) block frame, unit length.
        torque: greatest torque, mass·g·unit.
        momentum: momentum at the wheel's greatest speed, mass·unit²/s.
        steady_rate: turning rate of the block at which it brakes with all its torque, rad/s.
    """

    left: str
    right: str
    axis: Point
    torque: Positive
    momentum: Positive
    steady_rate: Positive


class Brake(Sourced, frozen=True, kw_only=True):
    """Air brake, which resists motion in every direction while it is open.

    The force is -coefficient · min(|v|, cap_speed) · v, less in thinner air.

    Attributes:
        opens: "once": the first action opens it for good; "unless": it is open, and folded while
            one of the actions is held.
        coefficient: mass/unit.
        cap_speed: speed above which the force grows only in proportion to the speed, units/s.
    """

    actions: tuple[str, ...]
    opens: Literal["once", "unless"]
    coefficient: Amount
    cap_speed: Positive


class Forces(Form, frozen=True, kw_only=True):
    """Forces that a module exerts by itself; None for each kind that it does not have.

    Attributes:
        strut: effect of a rigid connector's length; None if its length has none.
    """

    push: Push | None = None
    wing: Wing | None = None
    lift: Lift | None = None
    altitude: Altitude | None = None
    rope_mount: RopeMount | None = None
    spring: Spring | None = None
    strut: Strut | None = None
    decouple: Decoupling | None = None
    grip: Grip | None = None
    tank: Tank | None = None
    flywheel: Flywheel | None = None
    brake: Brake | None = None

    @property
    def greatest_push(self) -> float:
        """The most that fan and balloon together push the block with, mass·g."""
        push = self.push.force if self.push else 0.0
        lift = self.lift.force if self.lift else 0.0
        return push + lift + (self.altitude.most if self.altitude else 0.0)


FORCE_FIELDS = Forces.__struct_fields__


def check_forces(forces: Forces, *, kind: str, mass: float, link: str | None) -> None:
    """Check that a module's forces suit its kind, its mass and its link.

    Args:
        mass: mass units.
        link: connector's kind of link; None for blocks.

    Raises:
        FieldError: a force does not suit the module's kind, or is too strong for its mass.
    """
    for name in FORCE_FIELDS:
        force = getattr(forces, name)
        if force is not None and (kind == "connector") != (name in ("spring", "strut")):
            only = "a spring and a strut are connectors, and connectors have no other force"
            refuse(name, f"no {name}: {only}", force)
    if (forces.spring is not None) != (link == "spring"):
        expected = "a spring with the link spring, and none with another link"
        refuse("spring", expected, forces.spring)
    if forces.strut is not None and link not in ("rigid", None):
        refuse("strut", f"no strut: its link is {link}", forces.strut)
    wing, altitude, brake = forces.wing, forces.altitude, forces.brake
    if forces.tank is not None and forces.tank.mass >= mass:
        refuse("tank.mass", f"less than the block's mass of {mass:g}", forces.tank.mass)
    if brake is not None:
        limit = _FASTEST_LOSS * mass / brake.cap_speed
        _check_most("brake.coefficient", brake.coefficient, limit)
    if wing is not None:
        limit = _FASTEST_LOSS * mass / math.pow(wing.cap_speed, wing.power)
        _check_most("wing.coefficient", wing.coefficient, limit)
    if altitude is not None:
        _check_most("altitude.damping", altitude.damping, _MOST_DAMPING * mass)


def _check_most(place: str, value: float, limit: float) -> None:
    if value > limit:
        expected = f"a number of at most {limit:g}, which a simulation's steps can follow"
        refuse(place, expected, value)
