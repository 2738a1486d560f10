"""The forces that modules exert by themselves: of nozzles, wings, balloons, springs and others."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from buildarena_geometry.reading import Amount, Finite, Form, Point, Positive, refuse
from buildarena_geometry.rotations import Vector

_FASTEST_LOSS = 100.0  # 1/s; what air takes from a block faster than this, no step follows
_MOST_DAMPING = 3.0  # mass·g per unit/s and mass unit; the same for a held height
_STIFFEST = 1000.0  # mass·g per unit; a stiffer spring between small blocks outruns the step
_MOST_SPRING_DAMPING = 10.0  # mass·g per unit/s


class Push(Form, frozen=True, kw_only=True):
    """What pushes a block along one of its own directions while its key is held.

    Attributes:
        action: the action that switches it on.
        reverse: the action that pushes the other way; None if none does.
        direction: (3,) where it pushes the block, block frame, unit length.
        force: mass·g.
        needs_air: whether it pushes the less the thinner the air is.
        fuel: what it burns in a second at full push; 0 for what needs none.
        steady_speed: it brakes its own motion about the centre of mass, at this speed by all it
            can push, which is taken off from what its keys ask, units/s; None if it does not.
        origin: where the figures come from.
    """

    action: str
    reverse: str | None = None
    direction: Point
    force: Amount
    needs_air: bool = True
    fuel: Amount = 0.0
    steady_speed: Positive | None = None
    origin: str = ""


class Wing(Form, frozen=True, kw_only=True):
    """What air that streams past a block does to it.

    With v the velocity of the block's centre, n the normal and s the normal turned by the pitch,
    the force is -coefficient · (v·s) · min(|v|, cap_speed)^power · n.

    Attributes:
        normal: (3,) the direction of the force, block frame, unit length.
        pitch_deg: by how much s is turned from the normal about the block's z axis, from y
            towards x, degrees.
        coefficient: force per speed to the power of `power` + 1, mass·unit/s².
        power: how the force grows with the speed besides: 0, 1 or 2.
        cap_speed: the speed from which on it does not, units/s.
        one_sided: whether air that comes from behind, against the normal, does nothing.
        origin: where the figures come from.
    """

    normal: Point
    pitch_deg: Finite = 0.0
    coefficient: Amount
    power: Literal[0, 1, 2]
    cap_speed: Positive
    one_sided: bool = False
    origin: str = ""

    @property
    def flow(self) -> Vector:
        """(3,) the direction s of the flow that it answers to, block frame, unit length."""
        x, y, z = self.normal
        turn = math.radians(self.pitch_deg)
        cosine, sine = math.cos(turn), math.sin(turn)
        return (x * cosine + y * sine, y * cosine - x * sine, z)


class Lift(Form, frozen=True, kw_only=True):
    """What always pulls a block up.

    Attributes:
        force: mass·g; the block's own weight works against it.
        origin: where the figure comes from.
    """

    force: Amount
    origin: str = ""


class Altitude(Form, frozen=True, kw_only=True):
    """What holds a block at a height: a lift that grows with how far it is below.

    The lift is stiffness · (target - height) - damping · (rate of climb), from 0 to `most`.

    Attributes:
        most: mass·g.
        stiffness: mass·g per unit.
        damping: mass·g per unit/s.
        rise: the action that moves its target up.
        sink: the action that moves its target down.
        rate: how fast, units/s.
        origin: where the figures come from.
    """

    most: Amount
    stiffness: Positive
    damping: Amount
    rise: str
    sink: str
    rate: Positive
    origin: str = ""


class RopeMount(Form, frozen=True, kw_only=True):
    """A rope that holds a block to the face it sits on, in place of a joint.

    Attributes:
        length: of the rope when it is taut, units.
        origin: where the figure comes from.
    """

    length: Positive
    origin: str = ""


class Spring(Form, frozen=True, kw_only=True):
    """What a connector does that is neither a strut nor a rope: it pulls and pushes elastically.

    Attributes:
        stiffness: mass·g per unit by which it is longer than at rest.
        damping: mass·g per unit/s.
        contract: the action that shortens its length at rest; None if none does.
        shortest: share of its built length to which that shortens it.
        rate: share of its built length by which it does so in a second, 1/s.
        limit: the pull at which it gives way, mass·g.
        origin: where the figures come from.
    """

    stiffness: Annotated[float, Meta(gt=0.0, le=_STIFFEST)]
    damping: Annotated[float, Meta(ge=0.0, le=_MOST_SPRING_DAMPING)]
    contract: str | None = None
    shortest: Annotated[float, Meta(gt=0.0, le=1.0)]
    rate: Positive
    limit: Positive
    origin: str = ""


class Strut(Form, frozen=True, kw_only=True):
    """What a rigid connector's length does to it: it weighs more, and buckles (Euler's column).

    It has its module's mass for each unit of its length, and for the first unit if it is shorter.
    Pressed together by more than π² · bending_stiffness / length², it gives way.

    Attributes:
        bending_stiffness: Young's modulus times the section's second moment, mass·g·unit².
        origin: where the figure comes from.
    """

    bending_stiffness: Positive
    origin: str = ""


class Decoupling(Form, frozen=True, kw_only=True):
    """What lets go of the face that a block sits on, once, and pushes the two apart.

    Attributes:
        action: the action that does it.
        impulse: on either side, mass·unit/s.
        origin: where the figures come from.
    """

    action: str
    impulse: Amount
    origin: str = ""


class Grip(Form, frozen=True, kw_only=True):
    """What holds the first thing that comes near a block's far end.

    Attributes:
        grab: the action that makes it ready to hold again after a release.
        release: the action that lets go.
        reach: how near a thing must come, units.
        force: the pull at which it lets go by itself, mass·g.
        moment: the moment at which it does, mass·g·unit.
        origin: where the figures come from.
    """

    grab: str
    release: str
    reach: Positive
    force: Positive
    moment: Positive
    origin: str = ""


class Tank(Form, frozen=True, kw_only=True):
    """Fuel that a block holds, and shares with those that it touches and that take fuel as well.

    Attributes:
        fuel: how much, when it is full; 0 for what passes fuel on and holds none.
        mass: of that fuel, part of the block's mass, mass units.
        origin: where the figures come from.
    """

    fuel: Amount
    mass: Amount = 0.0
    origin: str = ""


class Flywheel(Form, frozen=True, kw_only=True):
    """A wheel inside a block, whose spinning up turns the block the other way.

    While no key asks, it brakes the block's turning about its axis.

    Attributes:
        left: the action that turns the block against the clock, seen against its axis.
        right: the action that turns it clockwise.
        axis: (3,) block frame, unit length.
        torque: the greatest, mass·g·unit.
        momentum: at which the wheel spins as fast as it can, mass·unit²/s.
        steady_rate: the block's turning at which it brakes with all its torque, rad/s.
        origin: where the figures come from.
    """

    left: str
    right: str
    axis: Point
    torque: Positive
    momentum: Positive
    steady_rate: Positive
    origin: str = ""


class Brake(Form, frozen=True, kw_only=True):
    """What air brakes a block with while it is open, whichever way it moves.

    The force is -coefficient · min(|v|, cap_speed) · v, less in thinner air.

    Attributes:
        actions: those that move it.
        opens: "once": the first of them opens it for good; "unless": it stands open and folds
            while one of them is held.
        coefficient: mass/unit.
        cap_speed: the speed from which on it grows no faster than the speed, units/s.
        origin: where the figures come from.
    """

    actions: tuple[str, ...]
    opens: Literal["once", "unless"]
    coefficient: Amount
    cap_speed: Positive
    origin: str = ""


class Forces(Form, frozen=True, kw_only=True):
    """The forces that a module exerts by itself; None where it has none of a kind.

    Attributes:
        push: a fan's.
        wing: what air does to it.
        lift: a balloon's.
        altitude: that of a balloon that holds its height.
        rope_mount: the rope it hangs on.
        spring: a connector's.
        strut: what a rigid connector's length does to it; None for one that is always the same.
        decouple: what lets go.
        grip: what holds.
        tank: its fuel.
        flywheel: what turns it.
        brake: what opens in the air.
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
    """Refuses forces that make no sense for a module.

    Args:
        forces: those of its entry in a module file.
        kind: what the module does.
        mass: mass units.
        link: what a connector is.

    Raises:
        MisfitError: one has no place in such a module, or is too strong for its mass.
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
        most = _FASTEST_LOSS * mass / brake.cap_speed
        _check_most("brake.coefficient", brake.coefficient, most)
    if wing is not None:
        most = _FASTEST_LOSS * mass / math.pow(wing.cap_speed, wing.power)
        _check_most("wing.coefficient", wing.coefficient, most)
    if altitude is not None:
        _check_most("altitude.damping", altitude.damping, _MOST_DAMPING * mass)


def _check_most(place: str, value: float, most: float) -> None:
    if value > most:
        expected = f"a number of at most {most:g}, which a simulation's steps can follow"
        refuse(place, expected, value)
