"""Joint loads: from the wrenches on the blocks to the force and moment in every joint.

Wrenches are in mass·g (moments in mass·g·unit), low-pass filtered in the axes of their component's
root cluster (not of a spinning wheel, where a steady load would look like a rotating one).
`docs/physics.md` derives the equations.
"""

import math
from dataclasses import dataclass

import numpy as np

from buildarena_simulation.constants import GRAVITY, LOAD_FILTER_S
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import PointForces
from buildarena_simulation.structure.free_directions import FreeDirections
from buildarena_simulation.structure.model import BoolArray, FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.stiffness import StiffnessModel
from buildarena_simulation.structure.vectors import (
    columns_of,
    cross,
    summed_at,
    summed_by,
    turned,
    turned_wrenches,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLoads:
    """Loads of the joints at one moment.

    Attributes:
        force: (M,) norm of the force, mass·g; 0 for unloaded members.
        moment: (M,) norm of the moment, mass·g·unit.
        ratio: (M,) the larger of force and moment over its limit; for connectors that share a face,
            that of their total force on it, if larger.
    """

    force: FloatArray
    moment: FloatArray
    ratio: FloatArray


class LoadModel:
    """Filtered joint loads of one machine through a trial.

    Args:
        clusters: Its clusters at the start.
        motion: Their motion at the start.
        gravity: Downward acceleration, units/s².

    Attributes:
        wind: Acceleration of every mass besides gravity, (3,), or of each block, (N, 3), world
            frame, units/s².
    """

    def __init__(
        self,
        structure: Structure,
        clusters: Clusters,
        motion: Motion,
        *,
        gravity: float = GRAVITY,
    ) -> None:
        self._structure = structure
        self._weights = structure.masses * (gravity / GRAVITY)
        self.wind: FloatArray = np.zeros(3)
        self._limits = (structure.members.share[:, None] * structure.members.limits).T.copy()
        self._buckles = bool(np.isfinite(structure.members.buckling).any())
        self._stiffness = StiffnessModel(structure)
        self._wrenches = np.zeros((len(structure), 6))
        self.holds: BoolArray = np.ones(len(structure.members), dtype=bool)
        self._enter(clusters, motion)
        self._inertial = np.zeros((len(clusters), 6))

    def filters(self) -> tuple[FloatArray, ...]:
        """Return the state of the filter, for `put_back`."""
        state = (self._wrenches, self._inertial, self._root_rotation, self._velocity, self._spin)
        return tuple(array.copy() for array in state)

    def put_back(self, filters: tuple[FloatArray, ...]) -> None:
        """Restore the state of the filter that `filters` returned."""
        self._wrenches, self._inertial, self._root_rotation, self._velocity, self._spin = filters

    def weigh(self, structure: Structure) -> None:
        """Set the masses of the machine from now on; `rebuild` sets those of its clusters."""
        self._weights = structure.masses * (self._weights / self._structure.masses)
        self._structure = structure

    def rebuild(self, clusters: Clusters, motion: Motion, *, released: bool = False) -> None:
        """Set the clusters left after a break or a release, and keep the filtered loads.

        Args:
            clusters: Present clusters.
            released: True if a joint was released. The forces that held the freed pieces are not in
                the filters, so their former loads would reappear as impacts: their filters restart.
                The heaviest piece keeps its own, or a bridge could drop weights to reset its load.
        """
        before = self._root_rotation[self._clusters.cluster_of]
        source = np.array([self._clusters.cluster_of[ids[0]] for ids in clusters.blocks])
        inertial_before = self._root_rotation[source]
        inertial = self._inertial[source]
        share = clusters.mass / self._clusters.mass[source]
        self._enter(clusters, motion)
        turn = self._root_rotation[clusters.cluster_of].transpose(0, 2, 1) @ before
        self._wrenches = turned_wrenches(turn, self._wrenches)
        turn = self._root_rotation.transpose(0, 2, 1) @ inertial_before
        self._inertial = turned_wrenches(turn, inertial) * share[:, None]
        if released:
            freed = _lighter_pieces(source, clusters.mass)
            self._inertial[freed] = 0.0
            self._wrenches[freed[clusters.cluster_of]] = 0.0

    def evaluate(
        self,
        forces: PointForces,
        motion: Motion,
        *,
        elapsed_s: float,
        seen_s: float,
        filter_s: float = LOAD_FILTER_S,
        fading: float = 1.0,
    ) -> JointLoads:
        """Return the joint loads now.

        Args:
            forces: Mean forces on the blocks, without gravity.
            elapsed_s: Time since the last evaluation, seconds.
            seen_s: The part of it that the forces are the mean of, seconds.
            filter_s: Time constant of the filter, seconds.
            fading: Share of the filtered loads that these give way to; the rest is added to.

        Returns:
            The loads of all members.
        """
        blend = 1.0 - math.exp(-seen_s / filter_s)
        self._update(forces, motion, elapsed_s=elapsed_s, blend=blend, fading=fading)
        clusters = self._clusters
        count = len(self.holds)
        force, moment = np.zeros(count), np.zeros(count)
        wrenches = self._wrenches
        if self._children:
            relative = motion.rotation.transpose(0, 2, 1) @ self._root_rotation
            wrenches = turned_wrenches(relative.take(clusters.cluster_of, 0), wrenches)
            self._add_joint_reactions(wrenches, motion, force, moment)
        members = self._solver.solve(self._relieved(wrenches))
        inside = self._solver.inside
        norms = np.sqrt(np.add.reduce((members * members).reshape(-1, 2, 3), axis=2))
        force[inside], moment[inside] = norms[:, 0], norms[:, 1]
        ratio = np.maximum(force / self._limits[0], moment / self._limits[1])
        if self._buckles:
            pressed = -members[:, 0] / self._structure.members.buckling[inside]
            ratio[inside] = np.maximum(ratio[inside], pressed)
        self._add_shared_faces(members, ratio)
        return JointLoads(force=force, moment=moment, ratio=ratio)

    def displacements(self, forces: PointForces, motion: Motion) -> FloatArray:
        """Return the blocks' displacements under forces and gravity, each cluster's ground fixed.

        Args:
            forces: Forces on the blocks, without gravity.

        Returns:
            (N, 6) displacement and turn of every block, in its cluster's axes; only differences
            within a cluster and ratios mean anything.
        """
        wrenches = self._unfiltered(forces, motion)
        relative = motion.rotation.transpose(0, 2, 1) @ self._root_rotation
        wrenches = turned_wrenches(relative.take(self._clusters.cluster_of, 0), wrenches)
        if self._children:
            count = len(self.holds)
            self._add_joint_reactions(wrenches, motion, np.zeros(count), np.zeros(count))
        return self._solver.displacements(self._relieved(wrenches))

    def flexibility(self, blocks: IntArray) -> FloatArray:
        """Return blocks' displacements under unit wrenches; see `MemberForces.flexibility`."""
        return self._solver.flexibility(blocks)

    def _enter(self, clusters: Clusters, motion: Motion) -> None:
        structure, parts = self._structure, self._structure.parts
        self._clusters = clusters
        self._root_rotation = motion.rotation[clusters.root]
        self._velocity, self._spin = motion.velocity, motion.spin
        self._solver = self._stiffness.factorize(clusters, self.holds)
        self._arm = structure.centers_of_mass - clusters.center_of_mass[clusters.cluster_of]
        self._columns = columns_of(clusters.cluster_of, 6)
        self._compliance = np.asarray(np.linalg.inv(clusters.inertia), dtype=np.float64)
        self._free = FreeDirections(structure, clusters)
        self._sliding = np.array(
            [a >= 0 and parts[a].physics.joint_type == "slider" for a in clusters.attached]
        )
        self._children = [
            np.flatnonzero(clusters.level == level)
            for level in range(int(clusters.level.max()), 0, -1)
        ]

    def _update(
        self, forces: PointForces, motion: Motion, *, elapsed_s: float, blend: float, fading: float
    ) -> None:
        """Filter the wrenches on the blocks and the clusters' rates of momentum."""
        clusters = self._clusters
        local = self._unfiltered(forces, motion)
        to_root = self._root_rotation.transpose(0, 2, 1)
        self._wrenches += blend * (local - fading * self._wrenches)
        rate = np.empty((len(clusters), 6))
        rate[:, :3] = clusters.mass[:, None] * (motion.velocity - self._velocity)
        inertia = motion.rotation @ clusters.inertia @ motion.rotation.transpose(0, 2, 1)
        rate[:, 3:] = turned(inertia, motion.spin - self._spin)
        rate /= elapsed_s * GRAVITY
        self._velocity, self._spin = motion.velocity, motion.spin
        self._inertial += blend * (turned_wrenches(to_root, rate) - fading * self._inertial)

    def _unfiltered(self, forces: PointForces, motion: Motion) -> FloatArray:
        """Return the wrenches on the blocks now, weight included, (N, 6), in their roots' axes."""
        structure, clusters = self._structure, self._clusters
        self._root_rotation = motion.rotation.take(clusters.root, 0)
        centers = motion.points(clusters, structure.centers_of_mass)
        wrenches = np.empty((len(forces.block), 6))
        wrenches[:, :3] = forces.force
        wrenches[:, 3:] = cross(forces.point - centers.take(forces.block, 0), forces.force)
        world = summed_by(forces.block, wrenches, len(structure))
        world /= GRAVITY
        world[:, 2] -= self._weights
        if self.wind.any():
            world[:, :3] += self._structure.masses[:, None] * (self.wind / GRAVITY)
        to_root = self._root_rotation.transpose(0, 2, 1)
        return turned_wrenches(to_root.take(clusters.cluster_of, 0), world)

    def _add_joint_reactions(
        self, wrenches: FloatArray, motion: Motion, force: FloatArray, moment: FloatArray
    ) -> None:
        """Add the load that each moving joint transmits to its two blocks, outermost joints first.

        The joint's load is the outer cluster's rate of momentum less its other loads; it includes
        drive, spring and stop. A wheel's axle breaks by its load across the axis, any other joint
        by its total load.

        Args:
            wrenches: (N, 6) on the blocks, each in its own cluster's axes; changed in place.
            force: (M,) filled in for the joints.
            moment: (M,) filled in for the joints.
        """
        structure, clusters = self._structure, self._clusters
        members, joints = structure.members, structure.joints
        relative = motion.rotation.transpose(0, 2, 1) @ self._root_rotation
        inertial = turned_wrenches(relative, self._inertial)
        for level in self._children:
            total = self._cluster_totals(wrenches)[level]
            needed = inertial[level] - total
            joint, attached = clusters.joint[level], clusters.attached[level]
            attached_is_outer = clusters.attached_is_outer[level]
            outer = np.where(attached_is_outer, members.second[joint], members.first[joint])
            inner = np.where(attached_is_outer, members.first[joint], members.second[joint])
            hinge = joints.points[attached]
            transmitted = needed[:, :3]
            at_hinge = needed[:, 3:] - cross(hinge - clusters.center_of_mass[level], transmitted)
            self._free.bound(level, motion, transmitted, at_hinge)
            wrenches[outer, :3] += transmitted
            wrenches[outer, 3:] += at_hinge + cross(
                hinge - structure.centers_of_mass[outer], transmitted
            )
            parent = clusters.parent[level]
            turn = relative[parent] @ relative[level].transpose(0, 2, 1)
            # A pivot is the same world point in both frames, on the axis both clusters share.
            back = np.concatenate([transmitted, at_hinge], axis=1)
            back = -turned_wrenches(turn, back)
            arm = self._pivots_in_parents(level, motion) - structure.centers_of_mass[inner]
            back[:, 3:] += cross(arm, back[:, :3])
            np.add.at(wrenches, inner, back)
            axis = joints.axes[attached]
            bending = at_hinge + cross(hinge - members.point[joint], transmitted)
            bending -= (bending * axis).sum(axis=1)[:, None] * axis
            bending = np.where(joints.simple[attached][:, None], bending, at_hinge)
            force[joint] = np.sqrt((transmitted**2).sum(axis=1))
            moment[joint] = np.sqrt((bending**2).sum(axis=1))

    def _pivots_in_parents(self, level: IntArray, motion: Motion) -> FloatArray:
        """Return the pivots of clusters' joints in their parents' frames, (L, 3)."""
        structure, clusters = self._structure, self._clusters
        attached = clusters.attached[level]
        points = structure.joints.points[attached].copy()
        for k in self._sliding[level].nonzero()[0]:
            c, parent = level[k], clusters.parent[level[k]]
            offset = motion.position[c] + motion.rotation[c] @ points[k] - motion.position[parent]
            points[k] = offset @ motion.rotation[parent]
        return points

    def _add_shared_faces(self, loads: FloatArray, ratio: FloatArray) -> None:
        """Raise the ratios of connectors to that of all connectors on one of their faces.

        Args:
            loads: (K, 6) of the members within clusters, member frame.
            ratio: (M,) changed in place.
        """
        members = self._structure.members
        if not len(members.ends):
            return
        of_member = np.zeros((len(members), 6))
        of_member[self._solver.inside] = turned_wrenches(members.frame[self._solver.inside], loads)
        member, sign, face = members.ends.T
        count = int(face.max()) + 1
        total = summed_by(face, sign[:, None] * of_member[member], count)
        norms = np.sqrt(np.add.reduce((total * total).reshape(-1, 2, 3), axis=2))[face]
        together = (norms / members.limits[member]).max(axis=1)
        loaded = (of_member[member] != 0.0).any(axis=1)
        np.maximum.at(ratio, member[loaded], together[loaded])

    def _cluster_totals(self, wrenches: FloatArray) -> FloatArray:
        """Return the resultant on each cluster about its centre of mass, (C, 6)."""
        both = wrenches.copy()
        both[:, 3:] += cross(self._arm, wrenches[:, :3])
        return summed_at(self._columns, both, len(self._clusters))

    def _relieved(self, wrenches: FloatArray) -> FloatArray:
        """Return the wrenches less what accelerates the blocks (inertia relief)."""
        structure, clusters = self._structure, self._clusters
        total = self._cluster_totals(wrenches)
        of = clusters.cluster_of
        a = (total[:, :3] / clusters.mass[:, None]).take(of, 0)
        alpha = turned(self._compliance, total[:, 3:]).take(of, 0)
        needed = np.empty_like(wrenches)
        np.multiply(structure.masses[:, None], a + cross(alpha, self._arm), out=needed[:, :3])
        needed[:, 3:] = turned(structure.inertias, alpha)
        return wrenches - needed


def _lighter_pieces(source: IntArray, mass: FloatArray) -> BoolArray:
    """Return true for clusters that are a piece of an earlier one, but not its heaviest, (C,).

    Args:
        source: (C,) the earlier cluster that each was part of.
        mass: (C,) of each.
    """
    order = np.argsort(-mass, kind="stable")
    heaviest = order[np.unique(source[order], return_index=True)[1]]
    lighter = np.ones(len(mass), dtype=bool)
    lighter[heaviest] = False
    return lighter
