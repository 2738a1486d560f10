"""What the blocks of a running trial exert by themselves, from their motion and the keys."""

from dataclasses import dataclass, field, replace

import numpy as np

from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import PointForces
from buildarena_simulation.structure.model import FloatArray, Ropes, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.own_forces import OwnForces, own_forces_of
from buildarena_simulation.structure.vectors import cross, summed_by, turned


@dataclass(frozen=True, slots=True, kw_only=True)
class Commands:
    """What the keys ask of the blocks for some time.

    Attributes:
        pushing: (P,) how far each fan is asked to push, 0 to 1.
        heights: (A,) by how much each held height was moved from where it began, units.
        kicks: (D,) force with which each block that let go pushes off, mass·unit/s².
        rests: (K,) length of each spring at rest, as a share of its built length.
    """

    pushing: FloatArray
    heights: FloatArray
    kicks: FloatArray
    rests: FloatArray


@dataclass(slots=True)
class ForceField:
    """Works out a trial's own forces; engines ask it, the load model takes their mean.

    Attributes:
        table: Who exerts what.
        ropes: The ropes and springs.
        commands: What the keys ask for now.
    """

    table: OwnForces
    ropes: Ropes
    commands: Commands = field(init=False)
    _targets: FloatArray | None = field(init=False, default=None)
    _sum: FloatArray = field(init=False)
    _count: int = field(init=False, default=0)
    _arms: tuple[Clusters | None, FloatArray] = field(init=False)

    def __post_init__(self) -> None:
        """Starts without any key held."""
        table = self.table
        self.commands = Commands(
            pushing=np.zeros(len(table.pushes)),
            heights=np.zeros(len(table.altitudes)),
            kicks=np.zeros(len(table.decouplers)),
            rests=np.ones(len(self.ropes.springs)),
        )
        self._sum = np.zeros((len(table), 3))
        self._arms = (None, table.point)

    def rest_lengths(self) -> FloatArray:
        """Length at rest of every rope and spring, (R,), units."""
        lengths = self.ropes.length.copy()
        lengths[self.ropes.springs] *= self.commands.rests
        return lengths

    def wrenches(self, clusters: Clusters, motion: Motion) -> FloatArray:
        """The wrench on each cluster about its centre of mass, (C, 6), machine frame axes.

        Args:
            clusters: The clusters.
            motion: Their motion now.
        """
        if not len(self.table):
            return np.zeros((len(clusters), 6))
        forces = self._forces(clusters, motion)
        self._sum += forces
        self._count += 1
        both = np.concatenate([forces, cross(self._arm(clusters), forces)], axis=1)
        return summed_by(clusters.cluster_of[self.table.block], both, len(clusters))

    def taken(self, clusters: Clusters, motion: Motion) -> PointForces:
        """The mean of the forces since the last call, at the blocks' present places."""
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
        """The force of each row, (R, 3), in the machine frame of its cluster."""
        table, commands = self.table, self.commands
        c = clusters.cluster_of[table.block]
        back = motion.rotation[c].transpose(0, 2, 1)
        arm = self._arm(clusters)
        velocity = turned(back, motion.velocity[c]) + cross(turned(back, motion.spin[c]), arm)
        w, p = len(table.wings), len(table.pushes)
        up = back[w + p :, :, 2]
        lifts = np.concatenate([table.lift, self._lifts(motion, back, velocity, c)])
        size = np.concatenate([table.push * commands.pushing, np.zeros(len(lifts))])
        kicks = np.tile(commands.kicks, 2)
        forces = np.concatenate([np.zeros(w), size, kicks])[:, None] * table.direction
        forces[:w] = table.wings.forces(velocity[:w], clusters.parent[c[:w]] < 0)
        forces[w + p : w + p + len(lifts)] = lifts[:, None] * up[: len(lifts)]
        return forces

    def _lifts(
        self, motion: Motion, back: FloatArray, velocity: FloatArray, c: np.ndarray
    ) -> FloatArray:
        """The lift of each block that holds its height, (A,), mass·unit/s².

        Args:
            motion: The clusters' motion.
            back: (R, 3, 3) machine_from_world of each row.
            velocity: (R, 3) of each row's point, machine frame, units/s.
            c: (R,) cluster of each row.
        """
        table = self.table
        if not len(table.altitudes):
            return np.zeros(0)
        first = len(table.wings) + len(table.pushes) + len(table.lift)
        rows = slice(first, first + len(table.altitudes))
        up = back[rows, :, 2]
        height = motion.position[c[rows], 2] + (up * table.point[rows]).sum(axis=1)
        if self._targets is None:
            self._targets = height
        climb = (up * velocity[rows]).sum(axis=1)
        stiffness, damping, most = np.array(
            [(of.stiffness, of.damping, of.most) for of in table.altitude_of]
        ).T
        below = self._targets + self.commands.heights - height
        return np.asarray(GRAVITY * np.clip(stiffness * below - damping * climb, 0.0, most))


def field_of(structure: Structure, *, drive_strength: float = 1.0) -> ForceField | None:
    """What a structure's blocks exert by themselves; None where none does.

    Args:
        structure: The machine.
        drive_strength: Share of their data with which fans push.
    """
    table = own_forces_of(structure)
    table = replace(table, push=table.push * drive_strength)
    grips = any(part.module.grip for part in structure.parts)
    exerted = len(table) or len(structure.ropes.springs) or grips
    return ForceField(table, structure.ropes) if exerted else None
