"""PyBullet behind the engine seam: one multibody per articulated piece, read from URDF text.

Why it is done this way: multibodies (not maximal coordinates) keep heavy cargo quiet;
`createCollisionShapeArray` drops shapes beyond 16, URDF text does not; compound inertia computed by
PyBullet is wrong, so ours is given; URDFs are cached by file name, so caching is off.
"""

import contextlib
import itertools
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from buildarena_simulation.constants import (
    COLLISION_MARGIN,
    FRICTION_BLOCK,
    FRICTION_TERRAIN,
    FRICTION_WHEEL,
    MAX_SPIN,
    WHEEL_TORQUE,
)
from buildarena_simulation.engines.base import (
    CargoPose,
    World,
    principal_frames,
    quaternion_of,
    rotation_of,
)
from buildarena_simulation.engines.jolts import JoltWatch
from buildarena_simulation.engines.ropes import rope_forces
from buildarena_simulation.engines.urdf import urdf_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.model import FloatArray, Role, ShapeKind
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross


@contextlib.contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """PyBullet greets on stdout when it is imported, where our own output may be JSON."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


with _stdout_to_stderr():
    import pybullet

_Push = tuple[int, int, list[float], list[float]]
_Drag = tuple[int, list[float], list[float]]

_TIME_STEP_S = 1 / 250
_STEPS_PER_EVALUATION = 10
_ITERATIONS = 50
_RESIDUAL = 1e-9
_SPEED_CAP = 1e5
_CANDIDATES = 16
"""Blocks considered for one contact: more than can meet in a point."""
_TIE = 0.02
"""A contact within this distance of several blocks is shared among them, units."""
_TOUCHING = 0.005
"""Points nearer than this touch, though the solver may have given them no force, units."""
_ORIGIN = (0.0, 0.0, 0.0)
_GROUND_REACH = 2000.0


def version() -> str:
    """Version of the PyBullet library."""
    from importlib.metadata import version as distribution_version  # noqa: PLC0415

    return distribution_version("pybullet")


class PyBulletEngine:
    """A PyBullet world; see `Engine` for what its methods mean."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._structure = world.structure
        self._torque = WHEEL_TORQUE * world.gravity
        self._rope_alive = np.ones(len(world.structure.ropes), dtype=bool)
        self._tensions = np.zeros(len(world.structure.ropes))
        self._client = pybullet.connect(pybullet.DIRECT)
        self._folder = Path(tempfile.mkdtemp(prefix="buildarena-"))
        self._serial = itertools.count()
        self._pieces: list[_Piece] = []
        self._place_of_wheel = {int(i): w for w, i in enumerate(world.structure.wheels)}
        self._start_world()

    @property
    def time_step_s(self) -> float:
        return _TIME_STEP_S

    @property
    def steps_per_evaluation(self) -> int:
        return _STEPS_PER_EVALUATION

    @property
    def settings(self) -> Mapping[str, float | int | str]:
        return {
            "time_step_s": _TIME_STEP_S,
            "steps_per_evaluation": _STEPS_PER_EVALUATION,
            "iterations": _ITERATIONS,
            "residual": _RESIDUAL,
            "cone_friction": 1,
        }

    def enter(self, clusters: Clusters, motion: Motion) -> None:
        self._clusters = clusters
        self._axes, self._moments = principal_frames(clusters)
        for piece in self._pieces:
            pybullet.removeBody(piece.body, physicsClientId=self._client)
        self._pieces = [self._add_piece(list(piece), motion) for piece in clusters.pieces]
        self._index_blocks()
        self._motion = motion

    def set_cargo_mass(self, mass: float) -> None:
        pybullet.changeDynamics(self._cargo, -1, mass=mass, physicsClientId=self._client)

    def drop_rope(self, index: int) -> None:
        self._rope_alive[index] = False

    def advance(self, wheel_speeds: FloatArray, thrusts: FloatArray) -> None:
        client = self._client
        pushes, drags = self._steady_pushes(thrusts)
        jolts = JoltWatch(len(wheel_speeds), gravity=self._world.gravity, time_step_s=_TIME_STEP_S)
        velocity = self._free_velocities()
        last: FloatArray | None = None
        for row in wheel_speeds:
            if len(row) and (last is None or (row != last).any()):
                self._drive(row)
                last = row
            for body, link, force, point in pushes:
                pybullet.applyExternalForce(
                    body, link, force, point, pybullet.LINK_FRAME, physicsClientId=client
                )
            for body, drag, spin_drag in drags:
                pybullet.applyExternalForce(
                    body, -1, drag, _ORIGIN, pybullet.LINK_FRAME, physicsClientId=client
                )
                pybullet.applyExternalTorque(
                    body, -1, spin_drag, pybullet.LINK_FRAME, physicsClientId=client
                )
            if self._rope_alive.any():
                self._pull_ropes()
            pybullet.stepSimulation(physicsClientId=client)
            before, velocity = velocity, self._free_velocities()
            if jolts.wants_reading(velocity - before):
                self._motion = self._read_motion()
                jolts.take(self._read_contacts())
        self._limit_spin()
        self._contacts = jolts.mean()

    def contacts(self) -> ContactForces:
        return self._contacts

    def rope_tensions(self) -> FloatArray:
        return self._tensions

    def motion(self) -> Motion:
        return self._motion

    def cargo(self) -> CargoPose:
        position, quaternion = pybullet.getBasePositionAndOrientation(
            self._cargo, physicsClientId=self._client
        )
        velocity, _ = pybullet.getBaseVelocity(self._cargo, physicsClientId=self._client)
        return CargoPose(
            position=np.array(position),
            quaternion=np.array(quaternion)[[3, 0, 1, 2]],
            velocity=np.array(velocity),
        )

    def close(self) -> None:
        pybullet.disconnect(physicsClientId=self._client)
        shutil.rmtree(self._folder, ignore_errors=True)

    # Building

    def _start_world(self) -> None:
        client, world = self._client, self._world
        pybullet.setGravity(0, 0, -world.gravity, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=_TIME_STEP_S,
            numSubSteps=0,
            numSolverIterations=_ITERATIONS,
            solverResidualThreshold=_RESIDUAL,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=client,
        )
        if world.ground:
            half = (_GROUND_REACH, _GROUND_REACH, 1.0)
            self._add_box(half, (0.0, 0.0, -1.0), mass=0.0)
        for box in world.terrain:
            self._add_box(tuple(v / 2 for v in box.size), box.center, mass=0.0)
        if world.cargo is not None:
            self._cargo = self._add_box(
                tuple(world.cargo.size / 2), tuple(world.cargo.position), mass=world.cargo.mass
            )

    def _add_box(
        self,
        half: tuple[float, ...],
        center: tuple[float, ...],
        *,
        mass: float,
    ) -> int:
        client = self._client
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client
        )
        body = pybullet.createMultiBody(
            mass, shape, basePosition=center, useMaximalCoordinates=0, physicsClientId=client
        )
        # One call for what belongs to the whole body, one for friction: mixing them on a link
        # drops the friction.
        pybullet.changeDynamics(
            body,
            -1,
            linearDamping=0,
            angularDamping=0,
            maxJointVelocity=_SPEED_CAP,
            physicsClientId=client,
        )
        pybullet.changeDynamics(
            body, -1, lateralFriction=FRICTION_TERRAIN, restitution=0, physicsClientId=client
        )
        return int(body)

    def _add_piece(self, inside: list[int], motion: Motion) -> "_Piece":
        client, clusters = self._client, self._clusters
        text = urdf_of(self._structure, clusters, inside, axes=self._axes, moments=self._moments)
        file = self._folder / f"{next(self._serial)}.urdf"
        file.write_text(text, encoding="ascii")
        root = inside[0]
        center = motion.centers_of_mass(clusters)[root]
        turn = quaternion_of(motion.rotation[root] @ self._axes[root])
        body = pybullet.loadURDF(
            str(file),
            center.tolist(),
            turn[[1, 2, 3, 0]].tolist(),
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE
            | pybullet.URDF_MAINTAIN_LINK_ORDER
            | pybullet.URDF_USE_IMPLICIT_CYLINDER,
            useMaximalCoordinates=0,
            physicsClientId=client,
        )
        file.unlink()
        pybullet.changeDynamics(
            body,
            -1,
            linearDamping=0,
            angularDamping=0,
            maxJointVelocity=_SPEED_CAP,
            physicsClientId=client,
        )
        pybullet.resetBaseVelocity(
            body, motion.velocity[root].tolist(), motion.spin[root].tolist(), physicsClientId=client
        )
        signs, places = [], []
        for link, c in enumerate(inside):
            wheels = any(self._structure.parts[i].role is Role.WHEEL for i in clusters.blocks[c])
            pybullet.changeDynamics(
                body,
                link - 1,
                lateralFriction=FRICTION_WHEEL if wheels and link else FRICTION_BLOCK,
                rollingFriction=0,
                spinningFriction=0,
                restitution=0,
                physicsClientId=client,
            )
            if link:
                wheel = int(clusters.wheel[c])
                axis = motion.rotation[c] @ self._structure.directions[wheel]
                rate = float((motion.spin[c] - motion.spin[clusters.parent[c]]) @ axis)
                pybullet.resetJointState(body, link - 1, 0.0, rate, physicsClientId=client)
                signs.append(1.0 if clusters.wheel_is_outer[c] else -1.0)
                places.append(self._place_of_wheel[wheel])
        mass = clusters.mass[inside]
        return _Piece(
            body=int(body),
            inside=inside,
            wheel_signs=np.array(signs),
            wheel_places=np.array(places, dtype=np.int64),
            hinge_rotation={
                c: motion.rotation[clusters.parent[c]].T @ motion.rotation[c] for c in inside[1:]
            },
            drag=float(clusters.linear_drag[inside] @ mass),
            spin_drag=float(clusters.angular_drag[root]),
        )

    def _index_blocks(self) -> None:
        """Tables that map a contact's body and link to the shapes of its cluster."""
        clusters, parts = self._clusters, self._structure.parts
        self._cluster_of_link = {
            (piece.body, link - 1): c
            for piece in self._pieces
            for link, c in enumerate(piece.inside)
        }
        self._free_bodies = [piece.body for piece in self._pieces]
        if self._world.cargo is not None:
            self._free_bodies.append(self._cargo)
        self._address = {c: key for key, c in self._cluster_of_link.items()}
        self._shapes = []
        for blocks in clusters.blocks:
            owned = [(i, shape) for i in blocks for shape in parts[i].shapes]
            halves = [
                shape.half_extents - (0.0 if shape.kind is ShapeKind.CYLINDER else COLLISION_MARGIN)
                for _, shape in owned
            ]
            self._shapes.append(
                _ShapeTable(
                    block=np.array([i for i, _ in owned], dtype=np.int64),
                    center=np.array([shape.center for _, shape in owned]),
                    rotation=np.array([shape.rotation for _, shape in owned]),
                    half=np.array(halves),
                )
            )

    # Stepping

    def _drive(self, speeds: FloatArray) -> None:
        for piece in self._pieces:
            count = len(piece.wheel_signs)
            if count:
                pybullet.setJointMotorControlArray(
                    piece.body,
                    range(count),
                    pybullet.VELOCITY_CONTROL,
                    targetVelocities=(speeds[piece.wheel_places] * piece.wheel_signs).tolist(),
                    forces=[self._torque] * count,
                    physicsClientId=self._client,
                )

    def _steady_pushes(self, thrusts: FloatArray) -> tuple[list[_Push], list[_Drag]]:
        """Thrust and drag for the steps until the next evaluation, in the links' own frames.

        Returns:
            Body, link, force and point of each thrust; body, force and torque of each piece's drag,
            from its velocity now (drag changes little within a few steps).
        """
        motion, clusters, structure = self._motion, self._clusters, self._structure
        pushes = []
        for cannon, thrust in zip(structure.cannons, thrusts, strict=True):
            if thrust:
                c = int(clusters.cluster_of[cannon])
                to_link = self._axes[c].T
                arm = structure.shown[cannon] - clusters.center_of_mass[c]
                force = -thrust * (to_link @ structure.directions[cannon])
                pushes.append((*self._address[c], force.tolist(), (to_link @ arm).tolist()))
        drags = []
        for piece in self._pieces:
            root = piece.inside[0]
            to_link = (motion.rotation[root] @ self._axes[root]).T
            force = -piece.drag * (to_link @ motion.velocity[root])
            torque = -piece.spin_drag * self._moments[root] * (to_link @ motion.spin[root])
            drags.append((piece.body, force.tolist(), torque.tolist()))
        return pushes, drags

    def _pull_ropes(self) -> None:
        structure, clusters = self._structure, self._clusters
        pulls = rope_forces(
            structure,
            clusters,
            self._read_motion(),
            alive=self._rope_alive,
            time_step_s=_TIME_STEP_S,
        )
        self._tensions = pulls.tension
        forces = pulls.forces
        for block, point, force in zip(forces.block, forces.point, forces.force, strict=True):
            body, link = self._address[int(clusters.cluster_of[block])]
            pybullet.applyExternalForce(
                body,
                link,
                force.tolist(),
                point.tolist(),
                pybullet.WORLD_FRAME,
                physicsClientId=self._client,
            )

    def _free_velocities(self) -> FloatArray:
        """Velocity of every piece and of the cargo, (K, 3), units/s."""
        return np.array(
            [
                pybullet.getBaseVelocity(body, physicsClientId=self._client)[0]
                for body in self._free_bodies
            ]
        )

    def _limit_spin(self) -> None:
        """Slows pieces that spin faster than any part of the game may."""
        for piece in self._pieces:
            root = piece.inside[0]
            speed = float(np.linalg.norm(self._motion.spin[root]))
            if speed > MAX_SPIN:
                pybullet.resetBaseVelocity(
                    piece.body,
                    self._motion.velocity[root].tolist(),
                    (self._motion.spin[root] * (MAX_SPIN / speed)).tolist(),
                    physicsClientId=self._client,
                )

    def _read_motion(self) -> Motion:
        """Poses and velocities of all clusters, children by way of their hinges' angles."""
        clusters, client = self._clusters, self._client
        count = len(clusters)
        position, rotation = np.empty((count, 3)), np.empty((count, 3, 3))
        velocity, spin = np.empty((count, 3)), np.empty((count, 3))
        for piece in self._pieces:
            root = piece.inside[0]
            center, turn = pybullet.getBasePositionAndOrientation(
                piece.body, physicsClientId=client
            )
            velocity[root], spin[root] = pybullet.getBaseVelocity(
                piece.body, physicsClientId=client
            )
            rotation[root] = rotation_of(np.array(turn)[[3, 0, 1, 2]]) @ self._axes[root].T
            position[root] = center - rotation[root] @ clusters.center_of_mass[root]
            if len(piece.inside) > 1:
                states = pybullet.getJointStates(
                    piece.body, range(len(piece.inside) - 1), physicsClientId=client
                )
                for c, state in zip(piece.inside[1:], states, strict=True):
                    self._read_child(piece, c, state, (position, rotation, velocity, spin))
        return Motion(position=position, rotation=rotation, velocity=velocity, spin=spin)

    def _read_child(
        self,
        piece: "_Piece",
        c: int,
        state: tuple[float, ...],
        arrays: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    ) -> None:
        position, rotation, velocity, spin = arrays
        clusters, structure = self._clusters, self._structure
        parent, wheel = int(clusters.parent[c]), int(clusters.wheel[c])
        axis, hinge = structure.directions[wheel], structure.positions[wheel]
        rotation[c] = rotation[parent] @ piece.hinge_rotation[c] @ _turn_about(axis, state[0])
        point = position[parent] + rotation[parent] @ hinge
        position[c] = point - rotation[c] @ hinge
        spin[c] = spin[parent] + state[1] * (rotation[c] @ axis)
        parent_center = position[parent] + rotation[parent] @ clusters.center_of_mass[parent]
        center = position[c] + rotation[c] @ clusters.center_of_mass[c]
        velocity[c] = (
            velocity[parent]
            + cross(spin[parent], point - parent_center)
            + cross(spin[c], center - point)
        )

    def _read_contacts(self) -> ContactForces:
        rows: dict[int, list[tuple[float, ...]]] = {}
        links = self._cluster_of_link
        for contact in pybullet.getContactPoints(physicsClientId=self._client):
            push = contact[9]
            if push == 0.0 and contact[8] > _TOUCHING:
                continue
            n, f1, d1, f2, d2 = contact[7], contact[10], contact[11], contact[12], contact[13]
            # The normal points from the second body to the first.
            force = tuple(n[k] * push + d1[k] * f1 + d2[k] * f2 for k in range(3))
            first = links.get((contact[1], contact[3]))
            second = links.get((contact[2], contact[4]))
            if first is not None:
                other = -contact[2] - 1 if second is None else second
                rows.setdefault(first, []).append((*contact[5], *force, *n, other))
            if second is not None:
                other = -contact[1] - 1 if first is None else first
                back = (*(-f for f in force), *(-v for v in n))
                rows.setdefault(second, []).append((*contact[6], *back, other))
        found = [self._to_blocks(c, np.array(table)) for c, table in sorted(rows.items())]
        return ContactForces(
            block=np.concatenate([np.zeros(0, dtype=np.int64), *(f.block for f in found)]),
            other=np.concatenate([np.zeros(0, dtype=np.int64), *(f.other for f in found)]),
            weight=np.concatenate([np.zeros(0), *(f.weight for f in found)]),
            normal=np.concatenate([np.zeros((0, 3)), *(f.normal for f in found)]),
            point=np.concatenate([np.zeros((0, 3)), *(f.point for f in found)]),
            force=np.concatenate([np.zeros((0, 3)), *(f.force for f in found)]),
        )

    def _to_blocks(self, c: int, table: FloatArray) -> ContactForces:
        """Gives each contact on a cluster to the nearest block; ties share it.

        PyBullet's contacts name the link but not the shape within it.
        """
        shapes, motion = self._shapes[c], self._motion
        local = (table[:, :3] - motion.position[c]) @ motion.rotation[c]
        candidates = shapes.nearest(local)
        apart = local[:, None] - shapes.center[candidates]
        along = np.abs((apart[:, :, None] @ shapes.rotation[candidates])[:, :, 0])
        outside = np.maximum(along - shapes.half[candidates], 0.0)
        distance = np.sqrt((outside * outside).sum(axis=2))
        near = distance <= distance.min(axis=1)[:, None] + _TIE
        weight = near / near.sum(axis=1)[:, None]
        row, column = np.nonzero(near)
        return ContactForces(
            block=shapes.block[candidates[row, column]],
            other=table[row, 9].astype(np.int64),
            weight=weight[row, column],
            normal=table[row, 6:9],
            point=table[row, :3],
            force=table[row, 3:6] * weight[row, column][:, None],
        )


class _Piece:
    """A multibody and what belongs to it."""

    __slots__ = (
        "body",
        "drag",
        "hinge_rotation",
        "inside",
        "spin_drag",
        "wheel_places",
        "wheel_signs",
    )

    def __init__(
        self,
        *,
        body: int,
        inside: list[int],
        wheel_signs: FloatArray,
        wheel_places: np.ndarray,
        hinge_rotation: dict[int, FloatArray],
        drag: float,
        spin_drag: float,
    ) -> None:
        self.body, self.inside = body, inside
        self.wheel_signs, self.wheel_places = wheel_signs, wheel_places
        self.hinge_rotation = hinge_rotation
        self.drag, self.spin_drag = drag, spin_drag


class _ShapeTable:
    """Shapes of one cluster, machine frame, and the blocks they belong to."""

    __slots__ = ("block", "center", "half", "rotation")

    def __init__(
        self, *, block: np.ndarray, center: FloatArray, rotation: FloatArray, half: FloatArray
    ) -> None:
        self.block, self.center, self.rotation, self.half = block, center, rotation, half

    def nearest(self, points: FloatArray) -> np.ndarray:
        """The few shapes whose centres are nearest to each point, (K, up to _CANDIDATES)."""
        count = len(self.block)
        if count <= _CANDIDATES:
            return np.broadcast_to(np.arange(count), (len(points), count))
        squares = (self.center * self.center).sum(axis=1) - 2.0 * points @ self.center.T
        return np.argpartition(squares, _CANDIDATES, axis=1)[:, :_CANDIDATES]


def _turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation by an angle about a unit axis (Rodrigues), (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
