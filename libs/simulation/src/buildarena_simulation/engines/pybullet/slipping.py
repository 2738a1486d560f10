"""Friction of powered wheels that slip, worked out here because PyBullet's is wrong for them.

PyBullet finds the friction of a contact along two fixed axes, each as if the wheel turned freely: a
slip along the wheel then counts several times less than one across it, and a wheel that spins or
brakes resists being pushed sideways far too much. It also leaves open how the wheels of one rigid
body share its weight. Here the friction on a slipping wheel is Coulomb's, against its slip, and the
loads are those of wheels that yield alike: the resultant of PyBullet's contacts, spread by statics.
A wheel that does not slip is left to PyBullet, which holds it without creep, and so is one between
two faces, as on the ground against a ridge.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from buildarena_simulation.engines.pybullet.bodies import friction_of, set_friction
from buildarena_simulation.engines.pybullet.contacts import TOUCHING
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.engines.shared.joint_frames import seat_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure

with quiet_output():
    import pybullet

_OFTEN_S, _SELDOM_S = 0.002, 0.02
"""Time between two looks at wheels, s: where one slips or motors were told something, or not."""

_LOADS_S: Final = 0.008
"""Time between two looks at their loads while they are looked at often, s."""

_WATCHED_S: Final = 0.1
"""How long wheels are looked at often after their motors were told something, s."""

_RESTLESS: Final = 1e-3
"""A step's change of a target, rad/s, by which wheels may begin to slip."""

_FREE: Final = 1e-9
"""Counts as the change of a target that there is none of, rad/s."""

_COUPLING: Final = 3.0
"""How much faster friction stops the slip of a machine's wheels than its mass alone says: what
turns the machine moves its wheels as well."""

_BLEND: Final = 0.5
"""Share of a look's loads in those that count: a hard contact's load jumps from step to step."""

_RISE: Final = 2.0
"""By how much a load rises from look to look at most, times what it was or an even share of the
weight: a blow lasts one step, and is not to count until the next look."""

_STARTS, _ENDS = 0.6, 0.2
"""A wheel slips from the first, and no longer from the second, times the slip that friction stops
between two looks."""

_PARALLEL: Final = 0.99
"""Cosine of the angle between normals above which contacts are with one face, and between a hinge
and the upright above which it only steers: it passes on its wheel's load as if it were rigid."""

_TRACE: Final = 1e-3
"""A push so small that it only says where a contact without one is, mass·unit/s²."""


_LINE: Final = 1e-6
"""Wheels in a line bear no moment about it; this share of their spread keeps that solvable."""

Vector = tuple[float, float, float]


@dataclass(slots=True, kw_only=True)
class Wheel:
    """A powered wheel and what it stands on.

    Attributes:
        cluster: Its cluster.
        parent: The cluster that it hangs on.
        mass: Of its whole component, mass units.
        friction: Its coefficient.
        slips: Whether its friction is ours.
        load: What it bears, mass·unit/s²; 0 where it does not stand on ground or terrain alone.
        pressed: Where the resultant of its contacts acts, world frame, units.
        point: Where it stands, below its middle, world frame, units.
        arm: From its centre of mass to there, world frame, units.
        normal: Of what it stands on, world frame.
        surface: The fixed body that it stands on.
        force: Friction on it, world frame, mass·unit/s².
    """

    cluster: int
    parent: int
    mass: float
    friction: float
    slips: bool = False
    load: float = 0.0
    pressed: Vector = (0.0, 0.0, 0.0)
    point: Vector = (0.0, 0.0, 0.0)
    arm: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    surface: int = -1
    force: Vector = (0.0, 0.0, 0.0)


def mean_of(points: Sequence[Vector], weights: Sequence[float]) -> Vector:
    """The weighted mean of some points; the weights have a sum above 0."""
    whole, x, y, z = 0.0, 0.0, 0.0, 0.0
    for (px, py, pz), weight in zip(points, weights, strict=True):
        whole += weight
        x, y, z = x + weight * px, y + weight * py, z + weight * pz
    return x / whole, y / whole, z / whole


def share(wheels: Sequence[Wheel]) -> None:
    """Spreads the load of wheels on one rigid body as if they yielded alike.

    With places x and y their loads become a + b·x + c·y, with the resultant and the moments that
    they had; wheels that would have to pull bear nothing.

    Args:
        wheels: The wheels; their loads are changed in place.
    """
    whole = sum(wheel.load for wheel in wheels)
    if whole == 0.0:
        return
    x, y, _ = mean_of([w.pressed for w in wheels], [w.load for w in wheels])
    bearing = list(wheels)
    while True:
        loads = _plane(bearing, whole, x, y)
        lowest = min(loads)
        if lowest >= 0.0 or len(bearing) == 1:
            break
        bearing[loads.index(lowest)].load = 0.0
        del bearing[loads.index(lowest)]
    for wheel, load in zip(bearing, loads, strict=True):
        wheel.load = load


def _plane(wheels: Sequence[Wheel], whole: float, x: float, y: float) -> list[float]:
    """Loads with the sum `whole` and their centre at (x, y)."""
    count = len(wheels)
    cx = sum(wheel.point[0] for wheel in wheels) / count
    cy = sum(wheel.point[1] for wheel in wheels) / count
    apart = [(wheel.point[0] - cx, wheel.point[1] - cy) for wheel in wheels]
    xx, yy = sum(dx * dx for dx, _ in apart), sum(dy * dy for _, dy in apart)
    xy = sum(dx * dy for dx, dy in apart)
    slack = _LINE * (xx + yy + 1.0)
    xx, yy = xx + slack, yy + slack
    mx, my = whole * (x - cx), whole * (y - cy)
    free = xx * yy - xy * xy
    b, c = (mx * yy - my * xy) / free, (my * xx - mx * xy) / free
    return [whole / count + b * dx + c * dy for dx, dy in apart]


class _Contact(NamedTuple):
    """Where a wheel touches ground or terrain: push, place and normal in the world, other body."""

    push: float
    place: Vector
    normal: Vector
    other: int


def changes_of(before: FloatArray | None, targets: FloatArray) -> list[float]:
    """By how much a driven joint's target changes at most in each step.

    Args:
        before: (D,) the targets before the first step; None if there were none.
        targets: (S, D) NaN where a joint turns freely, which counts as a small change.
    """
    if not targets.shape[1]:
        return [0.0] * len(targets)
    first = np.full(targets.shape[1], np.inf) if before is None else before
    changes = np.abs(np.diff(targets, axis=0, prepend=first[None]))
    return list(np.nan_to_num(changes, nan=_FREE, posinf=np.inf).max(axis=1).tolist())


class SlippingWheels:
    """The friction of the powered wheels of one world.

    Args:
        client: The engine's world.
        structure: The machine.
        surfaces: What `ContactForces.surface` calls each fixed body.
        gravity: Downward acceleration, units/s².
    """

    def __init__(
        self,
        client: Mapping[str, int],
        structure: Structure,
        surfaces: Mapping[int, int],
        gravity: float,
    ) -> None:
        self._client, self._structure, self._surfaces = client, structure, surfaces
        self._gravity = gravity

    def enter(
        self, clusters: Clusters, address: Mapping[int, tuple[int, int]], time_step_s: float
    ) -> None:
        """Takes over the wheels of new bodies.

        Args:
            clusters: The clusters.
            address: Body and link of each.
            time_step_s: Length of a step, seconds.
        """
        self._often, self._seldom, self._loads, self._watched = (
            round(time_s / time_step_s) for time_s in (_OFTEN_S, _SELDOM_S, _LOADS_S, _WATCHED_S)
        )
        self._left = self._watched
        self._wheels: dict[int, dict[int, Wheel]] = {}
        for component in clusters.components:
            mass = float(clusters.mass[list(component)].sum())
            for c in component[1:]:
                part = self._structure.parts[clusters.seated[c]]
                if part.is_wheel and part.module.motor and clusters.seated_is_outer[c]:
                    body, link = address[c]
                    self._wheels.setdefault(body, {})[link] = Wheel(
                        cluster=c,
                        parent=_borne(self._structure, clusters, int(clusters.parent[c])),
                        mass=mass,
                        friction=friction_of(self._structure, clusters.blocks[c]),
                    )

    def push(self, step: int, change: float) -> None:
        """Applies the friction of the next step.

        Args:
            step: Its number since the last evaluation.
            change: Of motors' targets in it at most, rad/s.
        """
        self._left = self._watched if change > _RESTLESS else self._left - 1
        client, frame = self._client, pybullet.WORLD_FRAME
        for body, wheels in self._wheels.items():
            often = self._left > 0 or any(wheel.slips for wheel in wheels.values())
            if step % (self._often if often else self._seldom) == 0:
                self._look(body, wheels, anew=not often or step % self._loads == 0)
            for link, wheel in wheels.items():
                if wheel.slips:
                    pybullet.applyExternalForce(
                        body, link, wheel.force, wheel.point, frame, **client
                    )

    def contacts(self) -> list[tuple[int, tuple[float, ...]]]:
        """Cluster and row of the friction on each slipping wheel, as in `read_contacts`."""
        return [
            (w.cluster, (*w.point, *w.force, *w.normal, w.surface))
            for wheels in self._wheels.values()
            for w in wheels.values()
            if w.slips
        ]

    def _look(self, body: int, wheels: Mapping[int, Wheel], *, anew: bool) -> None:
        """Works out the friction on a body's wheels until the next look.

        Args:
            body: The body.
            wheels: Its wheels by their links.
            anew: Whether their loads are read.
        """
        states = pybullet.getLinkStates(
            body, list(wheels), computeLinkVelocity=1, computeForwardKinematics=1, **self._client
        )
        if anew:
            self._read_loads(body, wheels, states)
        most = sum(wheel.friction * wheel.load for wheel in wheels.values())
        for (link, wheel), state in zip(wheels.items(), states, strict=True):
            if _rub(wheel, state, _COUPLING * most * _OFTEN_S / wheel.mass):
                held = 0.0 if wheel.slips else wheel.friction
                set_friction(self._client, body, link, held)

    def _read_loads(
        self, body: int, wheels: Mapping[int, Wheel], states: Sequence[Sequence[Any]]
    ) -> None:
        touching = self._touching(body, wheels)
        standing: dict[int, list[Wheel]] = {}
        before: dict[int, float] = {}
        for (link, wheel), state in zip(wheels.items(), states, strict=True):
            before[link], wheel.load = wheel.load, 0.0
            if contacts := touching.get(link):
                wheel.surface = self._surfaces[contacts[0].other]
                _stand(wheel, contacts, state[0])
                standing.setdefault(wheel.parent, []).append(wheel)
        for alike in standing.values():
            share(alike)
        for link in touching:
            wheel, was = wheels[link], before[link]
            blend = _BLEND if was > 0.0 else 1.0
            even = self._gravity * wheel.mass / len(wheels)
            wheel.load = min(was + blend * (wheel.load - was), _RISE * max(was, even))

    def _touching(self, body: int, wheels: Mapping[int, Wheel]) -> dict[int, list[_Contact]]:
        """Where each wheel touches; one that touches more than one face of them is left out."""
        touching: dict[int, list[_Contact]] = {}
        elsewhere = set()
        for contact in pybullet.getContactPoints(body, **self._client):
            push, ours = contact[9], contact[1] == body
            link, other = (contact[3], contact[2]) if ours else (contact[4], contact[1])
            if link not in wheels or (push == 0.0 and contact[8] > TOUCHING):
                continue
            if other not in self._surfaces:
                elsewhere.add(link)
                continue
            x, y, z = contact[7]
            place, normal = (contact[5], (x, y, z)) if ours else (contact[6], (-x, -y, -z))
            contacts = touching.setdefault(link, [])
            contacts.append(_Contact(push, place, normal, other))
            if _cosine(contacts[0].normal, normal) < _PARALLEL:
                elsewhere.add(link)
        for link in elsewhere:
            touching.pop(link, None)
        return touching


def _borne(structure: Structure, clusters: Clusters, c: int) -> int:
    """The cluster on which a wheel's cluster bears, through joints that only steer."""
    while clusters.parent[c] >= 0 and seat_of(structure, clusters, c) == "hinge":
        if abs(structure.joints.axes[clusters.seated[c]][2]) < _PARALLEL:
            break
        c = int(clusters.parent[c])
    return c


def _cosine(first: Vector, second: Vector) -> float:
    """Cosine of the angle between two unit vectors."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def _stand(wheel: Wheel, contacts: Sequence[_Contact], center: Vector) -> None:
    """Notes what a wheel bears and where: below its middle, as its edges take turns."""
    wheel.load = sum(contact.push for contact in contacts)
    wheel.pressed = mean_of([c.place for c in contacts], [c.push + _TRACE for c in contacts])
    wheel.normal = nx, ny, nz = contacts[0].normal
    (x, y, z), (px, py, pz) = center, wheel.pressed
    above = (x - px) * nx + (y - py) * ny + (z - pz) * nz
    wheel.arm = (-above * nx, -above * ny, -above * nz)
    wheel.point = (x + wheel.arm[0], y + wheel.arm[1], z + wheel.arm[2])


def _rub(wheel: Wheel, state: Sequence[Any], stopped: float) -> bool:
    """Works out the friction on a wheel, if that slips.

    Args:
        wheel: The wheel.
        state: Its link's.
        stopped: Slip that friction stops between two looks, units/s.

    Returns:
        Whether it began to slip or no longer slips.
    """
    before, wheel.slips = wheel.slips, False
    if wheel.load > 0.0:
        x, y, z = _slip(wheel, state[6], state[7])
        speed = math.sqrt(x * x + y * y + z * z)
        if speed > (_ENDS if before else _STARTS) * stopped:
            wheel.slips = True
            brake = -wheel.friction * wheel.load / speed
            wheel.force = (brake * x, brake * y, brake * z)
            (cx, cy, cz), (ax, ay, az) = state[0], wheel.arm
            wheel.point = (cx + ax, cy + ay, cz + az)
    return wheel.slips != before


def _slip(wheel: Wheel, velocity: Vector, spin: Vector) -> Vector:
    """Velocity of a wheel's rim where it stands, along what it stands on, units/s."""
    (vx, vy, vz), (ox, oy, oz), (x, y, z) = velocity, spin, wheel.arm
    vx, vy, vz = vx + oy * z - oz * y, vy + oz * x - ox * z, vz + ox * y - oy * x
    nx, ny, nz = wheel.normal
    into = vx * nx + vy * ny + vz * nz
    return vx - into * nx, vy - into * ny, vz - into * nz
