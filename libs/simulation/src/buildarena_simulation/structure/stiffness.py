"""Direct stiffness: from nodal wrenches to the forces in the joints.

Every block is a node of six degrees of freedom, every joint six springs at its midpoint. All
clusters are solved at once: the first block of each is its ground, whose reaction vanishes because
the loads are self-equilibrated.
"""

from collections.abc import Iterator, Sequence
from typing import Final, Protocol

import numpy as np

from buildarena_geometry.modules.joints import MOVING_JOINTS
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.free_directions import free_strains
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    BoolArray,
    FloatArray,
    IntArray,
    Structure,
)

_LEFT: Final = 1e-4
"""Share of a joint's stiffness that is left in its free directions: loops of joints that the rest
does not hold still are rigid here."""


class StiffnessModel:
    """Springs of a structure's members, ready to be factorised for any set of clusters.

    Args:
        structure: The machine; its machine frame is the frame of every wrench here.
    """

    def __init__(self, structure: Structure) -> None:
        members = structure.members
        count = len(members)
        self._node_count = len(structure)
        self._first, self._second = members.first, members.second
        frame = members.frame.transpose(0, 2, 1)
        strain = np.zeros((count, 6, 12))
        for side, nodes, sign in ((0, members.first, -1.0), (6, members.second, 1.0)):
            arm = members.point - structure.centers_of_mass[nodes]
            strain[:, :3, side : side + 3] = sign * frame
            strain[:, :3, side + 3 : side + 6] = -sign * frame @ _cross_matrices(arm)
            strain[:, 3:, side + 3 : side + 6] = sign * frame
        self._stress = members.stiffness[:, :, None] * strain
        for member, springs in _springs_that_give_way(structure):
            self._stress[member] = springs @ strain[member]
        self._element = strain.transpose(0, 2, 1) @ self._stress

    def factorize(self, clusters: Clusters, holds: BoolArray) -> "MemberForces":
        """Return the solver for one set of clusters.

        Args:
            holds: (M,) true for members that still hold.
        """
        inside = np.flatnonzero(
            holds & (clusters.cluster_of[self._first] == clusters.cluster_of[self._second])
        )
        grounds = np.array([ids[0] for ids in clusters.blocks])
        free = np.ones(self._node_count, dtype=bool)
        free[grounds] = False
        dof = np.full((self._node_count, 6), -1, dtype=np.int64)
        dof[free] = np.arange(6 * int(free.sum())).reshape(-1, 6)
        first, second = self._first[inside], self._second[inside]
        solver = self._factorized(inside, dof) if len(inside) and free.any() else None
        return MemberForces(
            inside=inside,
            free=free,
            stress=self._stress[inside],
            solver=solver,
            first=first,
            second=second,
        )

    def _factorized(self, inside: IntArray, dof: IntArray) -> "_Factorization":
        from scipy.sparse import coo_matrix
        from scipy.sparse.linalg import splu

        rows = np.concatenate([dof[self._first[inside]], dof[self._second[inside]]], axis=1)
        i = np.repeat(rows, 12, axis=1).reshape(-1)
        j = np.tile(rows, (1, 12)).reshape(-1)
        free = (i >= 0) & (j >= 0)
        size = int(dof.max()) + 1
        matrix = coo_matrix(
            (self._element[inside].reshape(-1)[free], (i[free], j[free])), shape=(size, size)
        )
        factorization: _Factorization = splu(
            matrix.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return factorization


class _Factorization(Protocol):
    """A factorised matrix, as SciPy's SuperLU gives it."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return the solution for one right-hand side."""


class MemberForces:
    """A factorised stiffness matrix; maps self-equilibrated wrenches to member forces.

    Attributes:
        inside: (K,) indices of the members it solves for: those within one cluster.
    """

    def __init__(
        self,
        *,
        inside: IntArray,
        free: BoolArray,
        stress: FloatArray,
        solver: _Factorization | None,
        first: IntArray,
        second: IntArray,
    ) -> None:
        self.inside = inside
        self._free = free
        self._stress = stress
        self._solver = solver
        self._first, self._second = first, second
        self._columns: dict[int, FloatArray] = {}
        self._flexible: tuple[tuple[int, ...], FloatArray] = ((), np.zeros((0, 6, 0, 6)))

    def displacements(self, wrenches: FloatArray) -> FloatArray:
        """Return the displacements and turns of the blocks, (N, 6), machine frame; see `solve`."""
        displacement = np.zeros_like(wrenches)
        if self._solver is not None:
            loads = wrenches[self._free].reshape(-1)
            displacement[self._free] = self._solver.solve(loads).reshape(-1, 6)
        return displacement

    def flexibility(self, blocks: IntArray) -> FloatArray:
        """Return blocks' displacements under unit wrenches, relative to their clusters' grounds.

        Args:
            blocks: (B,) indices of the blocks.

        Returns:
            (B, 6, B, 6) of displaced block, its degree of freedom, loaded block, its wrench.
        """
        key = tuple(blocks.tolist())
        if key != self._flexible[0]:
            missing_blocks = [block for block in key if block not in self._columns]
            if missing_blocks:
                self._solve_columns(missing_blocks)
            flexibility = np.empty((len(key), 6, len(key), 6))
            for k, block in enumerate(key):
                flexibility[:, :, k] = self._columns[block][blocks]
            self._flexible = (key, flexibility)
        return self._flexible[1]

    def _solve_columns(self, blocks: Sequence[int]) -> None:
        count = len(self._free)
        loads = np.zeros((count, 6, len(blocks), 6))
        for k, block in enumerate(blocks):
            loads[block, :, k] = np.eye(6)
        displacements = np.zeros_like(loads)
        if self._solver is not None:
            rhs = np.asfortranarray(loads[self._free].reshape(-1, 6 * len(blocks)))
            displacements[self._free] = self._solver.solve(rhs).reshape(-1, 6, len(blocks), 6)
        for k, block in enumerate(blocks):
            self._columns[block] = np.ascontiguousarray(displacements[:, :, k])

    def solve(self, wrenches: FloatArray) -> FloatArray:
        """Return forces and moments in the members.

        Args:
            wrenches: (N, 6) force and moment on each block about its centre of mass, machine frame,
                self-equilibrated within each cluster.

        Returns:
            (K, 6) force and moment in each member at its midpoint, member frame.
        """
        if self._solver is None:
            return np.zeros((len(self.inside), 6))
        displacement = self.displacements(wrenches)
        first, second = displacement.take(self._first, 0), displacement.take(self._second, 0)
        ends = np.concatenate([first, second], axis=1)
        return np.asarray((self._stress @ ends[:, :, None])[:, :, 0])


def _springs_that_give_way(structure: Structure) -> Iterator[tuple[int, FloatArray]]:
    """Yield moving joints without a drive, and their springs, (6, 6), soft in free directions."""
    members = structure.members
    for member, block in enumerate(members.second.tolist()):
        part = structure.parts[block]
        if JOINT_KINDS[members.kind[member]] not in MOVING_JOINTS:
            continue
        springs = np.diag(members.stiffness[member])
        free = free_strains(members, member, part)
        if free.size:
            resisted = springs @ free
            released = resisted @ np.linalg.solve(free.T @ resisted, resisted.T)
            yield member, springs - (1.0 - _LEFT) * released


def _cross_matrices(vectors: FloatArray) -> FloatArray:
    """Return the matrices of the cross product with each vector, (K, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
