"""Loads of a moving joint along its free directions: friction, a drive, or a stop.

A hinge transmits nothing about its pin, a slider nothing along its rail, a ball no moment at all. A
remainder of loads and inertia there is an error of the filter, or of the step, not a load.
"""

from typing import Final

import numpy as np

from buildarena_geometry.modules.joints import MovingJoint
from buildarena_simulation.structure.clusters import Clusters, limits_of
from buildarena_simulation.structure.model import FloatArray, IntArray, Members, Part, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross

STOP: Final = 0.05
"""Distance from a limit at which a joint rests on its stop, rad or units. Ours: engines' stops give
way by less."""


class FreeDirections:
    """Free directions of the clusters' joints, and the limits of their loads there."""

    def __init__(self, structure: Structure, clusters: Clusters) -> None:
        self._clusters = clusters
        count = len(clusters)
        self._axes = np.zeros((count, 3))
        self._bounds = np.full(count, np.inf)
        self._limits = np.zeros((count, 2))
        kinds = np.full(count, "", dtype="U17")
        meshed = {block for mesh in structure.joints.meshes for block in (mesh.first, mesh.second)}
        for c in np.flatnonzero(clusters.parent >= 0).tolist():
            attached = int(clusters.attached[c])
            # Teeth turn meshed cogs, and `LoadModel` projects a simple wheel's axle itself.
            if structure.joints.simple[attached] or attached in meshed:
                continue
            part = structure.parts[attached]
            self._axes[c] = structure.joints.axes[attached]
            self._bounds[c] = most_along(part.module.joint)
            kinds[c] = part.physics.joint_type
            self._limits[c] = limits_of(structure, clusters, c) or (-np.inf, np.inf)
        self._turning = np.isin(kinds, ("axle", "hinge"))
        self._sliding = kinds == "slider"
        self._other = np.isin(kinds, ("ball", "constant_velocity"))
        self._is_ball = kinds == "ball"

    def bound(
        self, level: IntArray, motion: Motion, transmitted: FloatArray, at_joint: FloatArray
    ) -> None:
        """Limit joint loads along free directions to what the joints can transmit.

        Args:
            level: (L,) the clusters that hang on the joints.
            transmitted: (L, 3) forces on them, in their own axes, mass·g; changed in place.
            at_joint: (L, 3) moments about the joints' points, mass·g·unit; changed in place.
        """
        for kind, loads in ((self._turning, at_joint), (self._sliding, transmitted)):
            rows = np.flatnonzero(kind[level])
            if len(rows):
                self._bound_along(level, rows, motion, loads, turning=kind is self._turning)
        for row in np.flatnonzero(self._other[level]).tolist():
            at_joint[row] = self._bound_moment(int(level[row]), motion, at_joint[row])

    def _bound_along(
        self, level: IntArray, rows: IntArray, motion: Motion, loads: FloatArray, *, turning: bool
    ) -> None:
        c = level[rows]
        axes, upper = self._axes[c], self._bounds[c]
        along = (loads[rows] * axes).sum(axis=1)
        place = self._angles(c, motion) if turning else self._shifts(c, motion)
        # A stop pushes back only.
        lower = np.where(place > self._limits[c, 1] - STOP, -np.inf, -upper)
        upper = np.where(place < self._limits[c, 0] + STOP, np.inf, upper)
        loads[rows] += (np.clip(along, lower, upper) - along)[:, None] * axes

    def _angles(self, c: IntArray, motion: Motion) -> FloatArray:
        turn = self._relative(c, motion)
        twice = np.stack(
            [
                turn[:, 2, 1] - turn[:, 1, 2],
                turn[:, 0, 2] - turn[:, 2, 0],
                turn[:, 1, 0] - turn[:, 0, 1],
            ],
            axis=1,
        )
        sine = (twice * self._axes[c]).sum(axis=1)
        return np.asarray(np.arctan2(sine, np.trace(turn, axis1=1, axis2=2) - 1.0))

    def _shifts(self, c: IntArray, motion: Motion) -> FloatArray:
        parent = self._clusters.parent[c]
        offset = motion.position[c] - motion.position[parent]
        rail = (motion.rotation[parent] @ self._axes[c][:, :, None])[:, :, 0]
        return np.asarray((offset * rail).sum(axis=1))

    def _relative(self, c: IntArray, motion: Motion) -> FloatArray:
        parent = self._clusters.parent[c]
        return motion.rotation[parent].transpose(0, 2, 1) @ motion.rotation[c]

    def _bound_moment(self, c: int, motion: Motion, moment: FloatArray) -> FloatArray:
        """Return the moment that a ball or a constant-velocity joint can transmit."""
        held = np.zeros(3)
        if not self._is_ball[c]:
            shaft = self._axes[c]
            other = self._relative(np.array([c]), motion)[0].T @ shaft
            if np.arccos(np.clip(shaft @ other, -1.0, 1.0)) > self._limits[c, 1] - STOP:
                return moment
            # Both shafts turn alike, so the moment between them halves the angle of their axes.
            between = (shaft + other) / np.linalg.norm(shaft + other)
            held = (moment @ between) * between
        free = moment - held
        size = float(np.linalg.norm(free))
        return held + free * min(1.0, self._bounds[c] / size) if size else moment


def most_along(joint: MovingJoint | None) -> float:
    """Return a joint's largest load in free directions, mass·g(·unit); infinite for a spring.

    Args:
        joint: None for a wheel that turns freely.
    """
    if joint is None:
        return 0.0
    if joint.stiffness or joint.damping:
        return np.inf
    return joint.friction if joint.drive is None else joint.drive.force


def free_strains(members: Members, member: int, part: Part) -> FloatArray:
    """Return the strains that a member's joint does not resist, (6, F), member frame.

    Args:
        member: Index of the member.
        part: Block that sits on it.

    Returns:
        Shift and turn at the member's midpoint, a column for each; no columns for a fixed joint:
        rigid, driven, or a wheel with a motor.
    """
    joint, kind = part.module.joint, part.physics.joint_type
    driven = part.module.motor is not None or (joint is not None and joint.drive is not None)
    arm = members.point[member] - part.pivot
    across = np.linalg.svd(part.axis[None])[2][1:] if part.axis.any() else np.eye(3)
    turned_about = {
        "axle": part.axis[None],
        "hinge": part.axis[None],
        "ball": np.eye(3),
        "constant_velocity": across,
    }
    if driven:
        return np.zeros((6, 0))
    if kind == "slider":
        strains = np.concatenate([part.axis[None], np.zeros((1, 3))], axis=1)
    else:
        axes = turned_about.get(kind, np.zeros((0, 3)))
        strains = np.concatenate([cross(axes, np.broadcast_to(arm, axes.shape)), axes], axis=1)
    to_member = members.frame[member].T
    both = np.concatenate([strains[:, :3] @ to_member.T, strains[:, 3:] @ to_member.T], axis=1)
    return np.asarray(both.T)
