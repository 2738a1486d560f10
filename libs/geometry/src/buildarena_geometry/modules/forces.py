"""The forces that modules exert by themselves: fans, wings, balloons, springs and what lets go."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from buildarena_geometry.rotations import Vector

if TYPE_CHECKING:
    from buildarena_geometry.reading import Fields, Reader

FORCE_FIELDS = ("push", "wing", "lift", "altitude", "tether", "spring", "decouple", "grip")
_POWERS = (0, 1, 2)
_FASTEST_LOSS = 100.0  # 1/s; what air takes from a block faster than this, no step follows
_MOST_DAMPING = 3.0  # mass·g per unit/s and mass unit; the same for a held height
_STIFFEST = 1000.0  # mass·g per unit; a stiffer spring between small blocks outruns the step
_MOST_SPRING_DAMPING = 10.0  # mass·g per unit/s


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """What pushes a block along one of its own directions while its key is held.

    Attributes:
        action: the action that switches it on.
        direction: (3,) where it pushes the block, block frame, unit length.
        force: mass·g.
        origin: where the figures come from.
    """

    action: str
    direction: Vector
    force: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wing:
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

    normal: Vector
    pitch_deg: float
    coefficient: float
    power: int
    cap_speed: float
    one_sided: bool = False
    origin: str = ""

    @property
    def flow(self) -> Vector:
        """(3,) the direction s of the flow that it answers to, block frame, unit length."""
        x, y, z = self.normal
        turn = math.radians(self.pitch_deg)
        cosine, sine = math.cos(turn), math.sin(turn)
        return (x * cosine + y * sine, y * cosine - x * sine, z)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lift:
    """What always pulls a block up.

    Attributes:
        force: mass·g; the block's own weight works against it.
        origin: where the figure comes from.
    """

    force: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Altitude:
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

    most: float
    stiffness: float
    damping: float
    rise: str
    sink: str
    rate: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tether:
    """A rope that holds a block to the face it sits on, in place of a joint.

    Attributes:
        length: of the rope when it is taut, units.
        origin: where the figure comes from.
    """

    length: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring:
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

    stiffness: float
    damping: float
    contract: str | None
    shortest: float
    rate: float
    limit: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoupling:
    """What lets go of the face that a block sits on, once, and pushes the two apart.

    Attributes:
        action: the action that does it.
        impulse: on either side, mass·unit/s.
        origin: where the figures come from.
    """

    action: str
    impulse: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grip:
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
    reach: float
    force: float
    moment: float
    origin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Forces:
    """The forces that a module exerts by itself; None where it has none of a kind.

    Attributes:
        push: a fan's.
        wing: what air does to it.
        lift: a balloon's.
        altitude: that of a balloon that holds its height.
        tether: the rope it hangs on.
        spring: a connector's.
        decouple: what lets go.
        grip: what holds.
    """

    push: Push | None = None
    wing: Wing | None = None
    lift: Lift | None = None
    altitude: Altitude | None = None
    tether: Tether | None = None
    spring: Spring | None = None
    decouple: Decoupling | None = None
    grip: Grip | None = None

    @property
    def greatest(self) -> float:
        """The most that fan and balloon together push the block with, mass·g."""
        push = self.push.force if self.push else 0.0
        lift = self.lift.force if self.lift else 0.0
        return push + lift + (self.altitude.most if self.altitude else 0.0)


NO_FORCES = Forces()


def read_forces(fields: Fields, actions: tuple[str, ...]) -> Forces:
    """The forces of an entry of a module file.

    Args:
        fields: the entry's fields.
        actions: what the module's keys can make it do.

    Raises:
        CatalogueError: a field breaks the format.
    """
    connector = fields["kind"].value == "connector"
    for name in FORCE_FIELDS:
        if fields.has(name) and connector != (name == "spring"):
            fields[name].fail(
                f"no {name}: a connector has no force but a spring's, "
                "and only connectors have a spring"
            )
    mass = fields["mass"].number(above=0)
    springs = fields.has("link") and fields["link"].value == "spring"
    if fields.has("spring") != springs:
        fields["spring"].fail("a spring with the link spring, and none with another link")
    return Forces(
        push=_push(fields["push"], actions) if fields.has("push") else None,
        wing=_wing(fields["wing"], mass) if fields.has("wing") else None,
        lift=_lift(fields["lift"]) if fields.has("lift") else None,
        altitude=_altitude(fields["altitude"], actions, mass) if fields.has("altitude") else None,
        tether=_tether(fields["tether"]) if fields.has("tether") else None,
        spring=_spring(fields["spring"], actions) if fields.has("spring") else None,
        decouple=_decoupling(fields["decouple"], actions) if fields.has("decouple") else None,
        grip=_grip(fields["grip"], actions) if fields.has("grip") else None,
    )


def _push(entry: Reader, actions: tuple[str, ...]) -> Push:
    fields = entry.fields(required=("action", "direction", "force"), optional=("origin",))
    return Push(
        action=fields["action"].choice(actions),
        direction=fields["direction"].direction(),
        force=fields["force"].number(least=0),
        origin=fields.text("origin"),
    )


def _wing(entry: Reader, mass: float) -> Wing:
    fields = entry.fields(
        required=("normal", "coefficient", "power", "cap_speed"),
        optional=("pitch_deg", "one_sided", "origin"),
    )
    power = fields["power"].integer()
    if power not in _POWERS:
        fields["power"].fail("0, 1 or 2")
    cap_speed = fields["cap_speed"].number(above=0)
    most = _FASTEST_LOSS * mass / cap_speed**power
    return Wing(
        normal=fields["normal"].direction(),
        pitch_deg=fields["pitch_deg"].number() if "pitch_deg" in fields else 0.0,
        coefficient=_up_to(most, fields["coefficient"], least=0.0),
        power=power,
        cap_speed=cap_speed,
        one_sided=fields["one_sided"].truth() if "one_sided" in fields else False,
        origin=fields.text("origin"),
    )


def _lift(entry: Reader) -> Lift:
    fields = entry.fields(required=("force",), optional=("origin",))
    return Lift(force=fields["force"].number(least=0), origin=fields.text("origin"))


def _altitude(entry: Reader, actions: tuple[str, ...], mass: float) -> Altitude:
    fields = entry.fields(
        required=("most", "stiffness", "damping", "rise", "sink", "rate"), optional=("origin",)
    )
    return Altitude(
        most=fields["most"].number(least=0),
        stiffness=fields["stiffness"].number(above=0),
        damping=_up_to(_MOST_DAMPING * mass, fields["damping"], least=0.0),
        rise=fields["rise"].choice(actions),
        sink=fields["sink"].choice(actions),
        rate=fields["rate"].number(above=0),
        origin=fields.text("origin"),
    )


def _tether(entry: Reader) -> Tether:
    fields = entry.fields(required=("length",), optional=("origin",))
    return Tether(length=fields["length"].number(above=0), origin=fields.text("origin"))


def _spring(entry: Reader, actions: tuple[str, ...]) -> Spring:
    fields = entry.fields(
        required=("stiffness", "damping", "shortest", "rate", "limit"),
        optional=("contract", "origin"),
    )
    shortest = fields["shortest"].number(above=0)
    if shortest > 1.0:
        fields["shortest"].fail("a share, above 0 and at most 1")
    return Spring(
        stiffness=_up_to(_STIFFEST, fields["stiffness"], above=0.0),
        damping=_up_to(_MOST_SPRING_DAMPING, fields["damping"], least=0.0),
        contract=fields["contract"].choice(actions) if fields.has("contract") else None,
        shortest=shortest,
        rate=fields["rate"].number(above=0),
        limit=fields["limit"].number(above=0),
        origin=fields.text("origin"),
    )


def _decoupling(entry: Reader, actions: tuple[str, ...]) -> Decoupling:
    fields = entry.fields(required=("action", "impulse"), optional=("origin",))
    return Decoupling(
        action=fields["action"].choice(actions),
        impulse=fields["impulse"].number(least=0),
        origin=fields.text("origin"),
    )


def _grip(entry: Reader, actions: tuple[str, ...]) -> Grip:
    fields = entry.fields(
        required=("grab", "release", "reach", "force", "moment"), optional=("origin",)
    )
    return Grip(
        grab=fields["grab"].choice(actions),
        release=fields["release"].choice(actions),
        reach=fields["reach"].number(above=0),
        force=fields["force"].number(above=0),
        moment=fields["moment"].number(above=0),
        origin=fields.text("origin"),
    )


def _up_to(
    most: float, entry: Reader, *, least: float | None = None, above: float | None = None
) -> float:
    number = entry.number(least=least, above=above)
    if number > most:
        entry.fail(f"a number of at most {most:g}, which a simulation's steps can follow")
    return number
