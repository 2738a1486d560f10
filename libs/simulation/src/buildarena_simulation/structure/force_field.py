"""Forces that the blocks of a running trial exert by themselves, from their motion and the keys."""

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from buildarena_simulation.constants import FORCES_EVERY_S, GRAVITY
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import PointForces
from buildarena_simulation.structure.model import FloatArray, Ropes, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.own_forces import OwnForces, own_forces_of
from buildarena_simulation.structure.vectors import cross, summed_by, turned

_AHEAD_S: Final = (FORCES_EVERY_S - 0.002) / 2
"""Time from an evaluation to the middle of the steps until the next one, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Gravity and air around a ball below the origin, or above a plane.

    Attributes:
        gravity: Acceleration on the ground, units/s².
        radius: Ball through the origin, units; None for a plane and the same air and
            pull everywhere.
        air: Drag on the ground as a share of the usual one.
        air_height: Height at which the air ends; up to there it thins out evenly, units.
    """

    gravity: float
    radius: float | None = None
    air: float = 1.0
    air_height: float = np.inf

    def pull(self, points: FloatArray) -> FloatArray:
        """Return its acceleration of masses, (K, 3), units/s².

        It falls with the square of the distance from the centre; inside the ball, where only loose
        parts that sank through the ground can be, it grows with the distance.

        Args:
            points: (K, 3) world frame, units.
        """
        if self.radius is None:
            return np.tile([0.0, 0.0, -self.gravity], (len(points), 1))
        arm = points + np.array([0.0, 0.0, self.radius])
        away = np.sqrt((arm * arm).sum(axis=1)) / self.radius
        return np.asarray(-(self.gravity / self.radius) * arm / np.maximum(away, 1.0)[:, None] ** 3)

    def up(self, points: FloatArray) -> FloatArray:
        """Return the upward direction, (K, 3), unit length."""
        if self.radius is None:
            return np.tile([0.0, 0.0, 1.0], (len(points), 1))
        arm = points + np.array([0.0, 0.0, self.radius])
        away = np.sqrt((arm * arm).sum(axis=1, keepdims=True))
        return np.asarray(arm / np.maximum(away, 1e-9))

    def height(self, points: FloatArray) -> FloatArray:
        """Return the heights above the ground, (K,), units."""
        if self.radius is None:
            return np.asarray(points[:, 2])
        arm = points + np.array([0.0, 0.0, self.radius])
        return np.asarray(np.sqrt((arm * arm).sum(axis=1)) - self.radius)

    def thinness(self, points: FloatArray) -> FloatArray:
        """Return the drag as a share of the usual one, (K,)."""
        if self.radius is None:
            return np.ones(len(points))
        share = 1.0 - self.height(points) / self.air_height
        return np.asarray(self.air * np.clip(share, 0.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Commands:
    """Commands of the keys to the blocks for some time.

    Attributes:
        pushing: (P,) command to each block that pushes, -1 to 1.
        heights: (A,) change of each held height since the start, units.
        open: (B,) true for open brakes.
        turning: (F,) command to each flywheel to turn its block, -1 to 1.
        kicks: (D,) force with which each released block pushes off, mass·unit/s².
        rests: (K,) length of each spring at rest, as a share of its built length.
    """

    pushing: FloatArray
    heights: FloatArray
    open: FloatArray
    turning: FloatArray
    kicks: FloatArray
    rests: FloatArray


@dataclass(slots=True)
class ForceField:
    """Computation of a trial's own forces; engines use them, the load model uses their mean.

    On a planet it includes gravity and drag, which the load model then omits.

    Attributes:
        table: Sources of forces.
        ropes: The ropes and springs.
        around: Gravity and air.
        commands: Present commands of the keys.
        spun: (F,) momentum of each flywheel about its axis, mass·unit²/s.
    """

    table: OwnForces
    ropes: Ropes
    around: Surroundings
    commands: Commands = field(init=False)
    _targets: FloatArray | None = field(init=False, default=None)
    _sum: FloatArray = field(init=False)
    _count: int = field(init=False, default=0)
    _arms: tuple[Clusters | None, FloatArray] = field(init=False)
    spun: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Start without any key held."""
        table = self.table
        self.commands = Commands(
            pushing=np.zeros(len(table.pushes)),
            heights=np.zeros(len(table.altitudes)),
            open=np.array([float(of.opens == "unless") for of in table.brake_of]),
            turning=np.zeros(len(table.flywheels)),
            kicks=np.zeros(len(table.decouplers)),
            rests=np.ones(len(self.ropes.springs)),
        )
        self._sum = np.zeros((len(table), 3))
        self._arms = (None, table.point)
        self.spun = np.zeros(len(table.flywheels))

    def rest_lengths(self) -> FloatArray:
        """Return the length at rest of every rope and spring, (R,), units."""
        lengths = self.ropes.length.copy()
        lengths[self.ropes.springs] *= self.commands.rests
        return lengths

    def wrenches(self, clusters: Clusters, motion: Motion) -> FloatArray:
        """Return the wrench on each cluster about its centre of mass, (C, 6), machine frame."""
        total = np.zeros((len(clusters), 6))
        if len(self.table):
            forces = self._forces(clusters, motion)
            self._sum += forces
            self._count += 1
            both = np.concatenate([forces, cross(self._arm(clusters), forces)], axis=1)
            total = summed_by(clusters.cluster_of[self.table.block], both, len(clusters))
        if self.around.radius is not None:
            total += _falling(self.around, clusters, motion)
        return total

    def take_mean(self, clusters: Clusters, motion: Motion) -> PointForces:
        """Return the mean of the forces since the last call, at the blocks' present positions."""
        table = self.table
        mean = self._sum / max(self._count, 1)
        self._sum, self._count = np.zeros_like(mean), 0
        c = clusters.cluster_of[table.block]
        turn = motion.rotation[c]
        return PointForces(
            block=table.block,
            point=motion.position[c] + turned(turn, table.point),
            force=turned(turn, mean),
        )

    def _arm(self, clusters: Clusters) -> FloatArray:
        if self._arms[0] is not clusters:
            c = clusters.cluster_of[self.table.block]
            self._arms = (clusters, self.table.point - clusters.center_of_mass[c])
        return self._arms[1]

    def _forces(self, clusters: Clusters, motion: Motion) -> FloatArray:
        """Return the force of each row, (R, 3), in the machine frame of its cluster."""
        table, commands = self.table, self.commands
        c = clusters.cluster_of[table.block]
        back = motion.rotation[c].transpose(0, 2, 1)
        arm = self._arm(clusters)
        swept = cross(turned(back, motion.spin[c]), arm)
        velocity = turned(back, motion.velocity[c]) + swept
        w, p = len(table.wings), len(table.pushes)
        places = motion.position[c] + turned(motion.rotation[c], table.point)
        air = self.around.thinness(places)
        up = turned(back, self.around.up(places))
        lifts = np.concatenate([table.lift, self._lifts(places, up, velocity)])
        b = w + p + len(lifts)
        brakes = slice(b, b + len(table.brakes))
        size = np.concatenate(
            [
                np.zeros(w),
                self._pushes(swept[w : w + p], air[w : w + p]),
                np.zeros(len(lifts) + len(table.brakes)),
                np.tile(commands.kicks, 2),
                np.tile(self._turns(turned(back, motion.spin[c])), 2),
            ]
        )
        forces = size[:, None] * table.direction
        forces[:w] = table.wings.forces(velocity[:w], clusters.parent[c[:w]] < 0)
        forces[:w] *= air[:w, None]
        forces[w + p : b] = (lifts * air[w + p : b])[:, None] * up[w + p : b]
        forces[brakes] = self._braked(velocity[brakes]) * air[brakes, None]
        return forces

    def _pushes(self, swept: FloatArray, air: FloatArray) -> FloatArray:
        """Return the force of each block that pushes, (P,), mass·unit/s².

        Args:
            swept: (P, 3) velocity about the centre of mass, machine frame, units/s.
            air: (P,) drag there as a share of the usual one.
        """
        table, asked = self.table, self.commands.pushing
        first = len(table.wings)
        along = (swept * table.direction[first : first + len(asked)]).sum(axis=1)
        level = np.clip(asked - along / table.steady_speed, -1.0, 1.0)
        return np.asarray(table.push * level * np.where(table.needs_air, np.minimum(air, 1.0), 1.0))

    def _braked(self, velocity: FloatArray) -> FloatArray:
        """Return the force of the air on each open brake, (B, 3), mass·unit/s²."""
        if not len(velocity):
            return velocity
        coefficient, cap = np.array(
            [(of.coefficient, of.cap_speed) for of in self.table.brake_of]
        ).T
        speed = np.minimum(np.sqrt((velocity * velocity).sum(axis=1)), cap)
        return np.asarray(-(self.commands.open * coefficient * speed)[:, None] * velocity)

    def _turns(self, spin: FloatArray) -> FloatArray:
        """Return each flywheel's torque on its block, (F,), mass·unit²/s², and spin it up as much.

        Args:
            spin: (R, 3) spin of each row's cluster, machine frame, rad/s.
        """
        table, asked = self.table, self.commands.turning
        if not len(asked):
            return asked
        torque, momentum, rate = np.array(
            [(GRAVITY * of.torque, of.momentum, of.steady_rate) for of in table.flywheel_of]
        ).T
        about = (spin[-len(asked) :] * table.turn_axis).sum(axis=1)
        level = np.where(asked == 0.0, -np.clip(about / rate, -1.0, 1.0), asked)
        upper = (self.spun + momentum) / FORCES_EVERY_S
        lower = (self.spun - momentum) / FORCES_EVERY_S
        exerted = np.clip(torque * level, lower, upper)
        self.spun = self.spun - FORCES_EVERY_S * exerted
        return np.asarray(exerted)

    def _lifts(self, places: FloatArray, up: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return the lift of each block that holds its height, (A,), mass·unit/s².

        Args:
            places: (R, 3) position of each row's point, world frame, units.
            up: (R, 3) upward direction there, machine frame.
            velocity: (R, 3) velocity of it, machine frame, units/s.
        """
        table = self.table
        if not len(table.altitudes):
            return np.zeros(0)
        first = len(table.wings) + len(table.pushes) + len(table.lift)
        rows = slice(first, first + len(table.altitudes))
        height = self.around.height(places[rows])
        if self._targets is None:
            self._targets = height
        climb = (up[rows] * velocity[rows]).sum(axis=1)
        stiffness, damping, limit = np.array(
            [(of.stiffness, of.damping, of.most) for of in table.altitude_of]
        ).T
        below = self._targets + self.commands.heights - height
        return np.asarray(GRAVITY * np.clip(stiffness * below - damping * climb, 0.0, limit))


def _falling(around: Surroundings, clusters: Clusters, motion: Motion) -> FloatArray:
    """Return gravity and drag of each cluster about its centre of mass, (C, 6), machine frame.

    Gravity is that of the middle of the steps in which it stays the same, so that a path round a
    planet neither gains nor loses energy.
    """
    centers, back = motion.centers_of_mass(clusters), motion.rotation.transpose(0, 2, 1)
    air = around.thinness(centers)
    slowed = (air * clusters.linear_drag)[:, None] * motion.velocity
    gained = around.pull(centers + _AHEAD_S * motion.velocity) - slowed
    # What turns on an axle is carried along by the root of its component.
    loses = np.where(clusters.parent < 0, air * clusters.angular_drag, 0.0)
    torque = -loses[:, None] * turned(clusters.inertia, turned(back, motion.spin))
    return np.concatenate([clusters.mass[:, None] * turned(back, gained), torque], axis=1)


def field_of(
    structure: Structure, *, drive_strength: float = 1.0, around: Surroundings
) -> ForceField | None:
    """Return the forces that a structure's blocks exert by themselves; None if there are none.

    Args:
        drive_strength: Push of fans as a share of their data.
        around: Gravity and air.
    """
    table = own_forces_of(structure)
    table = replace(table, push=table.push * drive_strength)
    grips = any(part.module.grip for part in structure.parts)
    exerted = len(table) or len(structure.ropes.springs) or grips or around.radius
    return ForceField(table, structure.ropes, around) if exerted else None
