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
from buildarena_simulation.engines.shared.joint_frames import joint_type_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure

with quiet_output():
    import pybullet

_OFTEN_S, _SELDOM_S = 0.002, 0.02
"""Interval of reading wheels, s: while one slips or after motors' targets changed, or else."""

_LOADS_S: Final = 0.008
"""Interval of reading their loads while they are read often, s."""

_WATCHED_S: Final = 0.1
"""Time for which wheels are read often after their motors' targets changed, s."""

_RESTLESS: Final = 1e-3
"""Change of a target in a step, rad/s, at which wheels may begin to slip."""

_FREE: Final = 1e-9
"""Nominal change of a missing target, rad/s."""

_COUPLING: Final = 3.0
"""Factor by which friction stops the slip of a machine's wheels faster than for its mass: what
turns the machine moves its wheels as well."""

_BLEND: Final = 0.5
"""Weight of a new load in the filtered one: a hard contact's load jumps from step to step."""

_RISE: Final = 2.0
"""Maximum rise of a load between readings, as a multiple of the last one or an even share of the
weight: an impact lasts one step, and must not count until the next reading."""

_STARTS, _ENDS = 0.6, 0.2
"""A wheel slips from the first, and no longer from the second, times the slip that friction stops
between two readings."""

_PARALLEL: Final = 0.99
"""Cosine of the angle between normals above which contacts are with one face, and between a hinge
and the upright above which it only steers: it passes on its wheel's load as if it were rigid."""

_TRACE: Final = 1e-3
"""A negligible push that marks the position of a contact without one, mass·unit/s²."""


_LINE: Final = 1e-6
"""Share of the spread that keeps the system solvable for wheels in a line, which take no moment."""

Vector = tuple[float, float, float]


@dataclass(slots=True, kw_only=True)
class Wheel:
    """A powered wheel and its contact with the ground.

    Attributes:
        parent: Cluster that it is attached to.
        mass: Mass of its component, mass units.
        friction: Coefficient of friction.
        slips: True if its friction is computed here.
        load: Normal force, mass·unit/s²; 0 unless it touches ground or terrain only.
        pressed: Point of the resultant of its contacts, world frame, units.
        point: Point of contact, below its middle, world frame, units.
        arm: Vector from its centre of mass to that point, world frame, units.
        normal: Normal of the surface, world frame.
        surface: Fixed body that it touches.
        force: Friction force on it, world frame, mass·unit/s².
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
    """Return the weighted mean of some points; the weights have a sum above 0."""
    total, x, y, z = 0.0, 0.0, 0.0, 0.0
    for (px, py, pz), weight in zip(points, weights, strict=True):
        total += weight
        x, y, z = x + weight * px, y + weight * py, z + weight * pz
    return x / total, y / total, z / total


def share(wheels: Sequence[Wheel]) -> None:
    """Distribute the load of wheels on one rigid body as if they were equally compliant.

    At positions x and y their loads become a + b·x + c·y, with the same resultant and moments;
    wheels that would have to pull get no load.

    Args:
        wheels: Wheels, whose loads are changed in place.
    """
    total = sum(wheel.load for wheel in wheels)
    if total == 0.0:
        return
    x, y, _ = mean_of([w.pressed for w in wheels], [w.load for w in wheels])
    bearing = list(wheels)
    while True:
        loads = _plane(bearing, total, x, y)
        lowest = min(loads)
        if lowest >= 0.0 or len(bearing) == 1:
            break
        bearing[loads.index(lowest)].load = 0.0
        del bearing[loads.index(lowest)]
    for wheel, load in zip(bearing, loads, strict=True):
        wheel.load = load


def _plane(wheels: Sequence[Wheel], total: float, x: float, y: float) -> list[float]:
    """Return loads with the sum `total` and their centre at (x, y)."""
    count = len(wheels)
    cx = sum(wheel.point[0] for wheel in wheels) / count
    cy = sum(wheel.point[1] for wheel in wheels) / count
    offsets = [(wheel.point[0] - cx, wheel.point[1] - cy) for wheel in wheels]
    xx, yy = sum(dx * dx for dx, _ in offsets), sum(dy * dy for _, dy in offsets)
    xy = sum(dx * dy for dx, dy in offsets)
    slack = _LINE * (xx + yy + 1.0)
    xx, yy = xx + slack, yy + slack
    mx, my = total * (x - cx), total * (y - cy)
    free = xx * yy - xy * xy
    b, c = (mx * yy - my * xy) / free, (my * xx - mx * xy) / free
    return [total / count + b * dx + c * dy for dx, dy in offsets]


class _Contact(NamedTuple):
    """A wheel's contact with ground or terrain: push, point and normal in the world, other body."""

    push: float
    place: Vector
    normal: Vector
    other: int


def changes_of(before: FloatArray | None, targets: FloatArray) -> list[float]:
    """Return the largest change of a driven joint's target in each step.

    Args:
        before: (D,) targets before the first step; None if there were none.
        targets: (S, D) NaN where a joint turns freely, which counts as a small change.
    """
    if not targets.shape[1]:
        return [0.0] * len(targets)
    first = np.full(targets.shape[1], np.inf) if before is None else before
    changes = np.abs(np.diff(targets, axis=0, prepend=first[None]))
    return list(np.nan_to_num(changes, nan=_FREE, posinf=np.inf).max(axis=1).tolist())


class SlippingWheels:
    """Friction of the powered wheels of one world.

    Args:
        client: The engine's world.
        surfaces: Number of each fixed body in `ContactForces.surface`.
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
        """Set the wheels of new bodies.

        Args:
            address: Body and link of each cluster.
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
                part = self._structure.parts[clusters.attached[c]]
                if part.is_wheel and part.module.motor and clusters.attached_is_outer[c]:
                    body, link = address[c]
                    self._wheels.setdefault(body, {})[link] = Wheel(
                        cluster=c,
                        parent=_find_support(self._structure, clusters, int(clusters.parent[c])),
                        mass=mass,
                        friction=friction_of(self._structure, clusters.blocks[c]),
                    )

    def push(self, step: int, change: float) -> None:
        """Apply the friction of the next step.

        Args:
            step: Number of the step since the last evaluation.
            change: Largest change of a motor's target in it, rad/s.
        """
        self._left = self._watched if change > _RESTLESS else self._left - 1
        client, frame = self._client, pybullet.WORLD_FRAME
        for body, wheels in self._wheels.items():
            often = self._left > 0 or any(wheel.slips for wheel in wheels.values())
            if step % (self._often if often else self._seldom) == 0:
                self._look(body, wheels, reload=not often or step % self._loads == 0)
            for link, wheel in wheels.items():
                if wheel.slips:
                    pybullet.applyExternalForce(
                        body, link, wheel.force, wheel.point, frame, **client
                    )

    def contacts(self) -> list[tuple[int, tuple[float, ...]]]:
        """Return cluster and row of the friction on each slipping wheel, as in `read_contacts`."""
        return [
            (w.cluster, (*w.point, *w.force, *w.normal, w.surface))
            for wheels in self._wheels.values()
            for w in wheels.values()
            if w.slips
        ]

    def _look(self, body: int, wheels: Mapping[int, Wheel], *, reload: bool) -> None:
        """Compute the friction on a body's wheels until the next call.

        Args:
            wheels: Wheels by their links.
            reload: True to read their loads again.
        """
        states = pybullet.getLinkStates(
            body, list(wheels), computeLinkVelocity=1, computeForwardKinematics=1, **self._client
        )
        if reload:
            self._read_loads(body, wheels, states)
        limit = sum(wheel.friction * wheel.load for wheel in wheels.values())
        for (link, wheel), state in zip(wheels.items(), states, strict=True):
            if _rub(wheel, state, _COUPLING * limit * _OFTEN_S / wheel.mass):
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
        """Return the contacts of each wheel, without wheels that touch several faces."""
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


def _find_support(structure: Structure, clusters: Clusters, c: int) -> int:
    """Return the cluster that a wheel's cluster rests on, through joints that only steer."""
    while clusters.parent[c] >= 0 and joint_type_of(structure, clusters, c) == "hinge":
        if abs(structure.joints.axes[clusters.attached[c]][2]) < _PARALLEL:
            break
        c = int(clusters.parent[c])
    return c


def _cosine(first: Vector, second: Vector) -> float:
    """Return the cosine of the angle between two unit vectors."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def _stand(wheel: Wheel, contacts: Sequence[_Contact], center: Vector) -> None:
    """Set a wheel's load and its point of contact, below its middle as its edges take turns."""
    wheel.load = sum(contact.push for contact in contacts)
    wheel.pressed = mean_of([c.place for c in contacts], [c.push + _TRACE for c in contacts])
    wheel.normal = nx, ny, nz = contacts[0].normal
    (x, y, z), (px, py, pz) = center, wheel.pressed
    above = (x - px) * nx + (y - py) * ny + (z - pz) * nz
    wheel.arm = (-above * nx, -above * ny, -above * nz)
    wheel.point = (x + wheel.arm[0], y + wheel.arm[1], z + wheel.arm[2])


def _rub(wheel: Wheel, state: Sequence[Any], stopped: float) -> bool:
    """Compute the friction on a wheel, if it slips.

    Args:
        state: State of its link.
        stopped: Slip that friction stops between two calls, units/s.

    Returns:
        True if it started or stopped slipping.
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
    """Return the velocity of a wheel's rim at the contact, along the surface, units/s."""
    (vx, vy, vz), (ox, oy, oz), (x, y, z) = velocity, spin, wheel.arm
    vx, vy, vz = vx + oy * z - oz * y, vy + oz * x - ox * z, vz + ox * y - oy * x
    nx, ny, nz = wheel.normal
    into = vx * nx + vy * ny + vz * nz
    return vx - into * nx, vy - into * ny, vz - into * nz
