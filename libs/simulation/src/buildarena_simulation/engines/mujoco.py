"""MuJoCo behind the engine seam: one body per cluster, one geom per block, hinges for axles."""

from collections.abc import Mapping

import mujoco
import numpy as np

from buildarena_simulation.constants import (
    COLLISION_MARGIN,
    FRICTION_BLOCK,
    FRICTION_TERRAIN,
    FRICTION_WHEEL,
    MAX_SPIN,
    WHEEL_TORQUE,
)
from buildarena_simulation.engines.base import CargoPose, World, principal_frames, quaternion_of
from buildarena_simulation.engines.jolts import JoltWatch
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.model import FloatArray, Role, ShapeKind
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross, turned

_TIME_STEP_S = 0.01
_STEPS_PER_EVALUATION = 4
_SOLREF = (0.02, 1.0)
_SOLIMP = (0.95, 0.995, 0.005, 0.5, 2.0)
_IMPRATIO = 10.0
_ITERATIONS = 50
_SERVO_GAIN_PER_TORQUE = 0.5
"""Torque limit of a wheel is reached at 2 rad/s off its target: stiff, yet smooth at rest."""

_TERRAIN_PRIORITY, _CARGO_PRIORITY, _BLOCK_PRIORITY, _WHEEL_PRIORITY = 0, 1, 2, 3
"""A contact takes its friction from the geom of higher priority."""


def version() -> str:
    """Version of the MuJoCo library."""
    return str(mujoco.__version__)


class MujocoEngine:
    """A MuJoCo world; see `Engine` for what its methods mean."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._structure = world.structure
        self._torque = WHEEL_TORQUE * world.gravity
        self._rope_alive = np.ones(len(world.structure.ropes), dtype=bool)
        self._cargo_mass = world.cargo.mass if world.cargo else 0.0
        self._cargo_state: tuple[FloatArray, FloatArray] | None = None

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
            "integrator": "implicitfast",
            "cone": "elliptic",
            "impratio": _IMPRATIO,
            "iterations": _ITERATIONS,
            "solref": str(_SOLREF),
            "solimp": str(_SOLIMP),
        }

    def enter(self, clusters: Clusters, motion: Motion) -> None:
        if self._world.cargo and hasattr(self, "_data"):
            self._cargo_state = (self._data.qpos[:7].copy(), self._data.qvel[:6].copy())
        self._clusters = clusters
        self._axes, self._moments = principal_frames(clusters)
        spec = self._empty_spec()
        self._add_static(spec)
        self._add_cargo(spec)
        self._add_clusters(spec, motion)
        self._add_ropes(spec)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._find_addresses()
        self._set_drag()
        self._set_velocities(motion)
        mujoco.mj_forward(self._model, self._data)

    def set_cargo_mass(self, mass: float) -> None:
        body, model = self._cargo_body, self._model
        model.body_mass[body] = mass
        model.body_inertia[body] = self._cargo_unit_inertia * mass
        model.body_subtreemass[body] = mass
        # The solver scales contact softness by these; for a free body they go with 1 / mass.
        model.body_invweight0[body] = self._cargo_unit_invweight / mass
        model.dof_invweight0[:6] = self._cargo_unit_dof_invweight / mass
        self._cargo_mass = mass

    def drop_rope(self, index: int) -> None:
        self._rope_alive[index] = False
        self._model.tendon_limited[self._tendon_of[index]] = 0

    def advance(self, wheel_speeds: FloatArray, thrusts: FloatArray) -> None:
        model, data = self._model, self._data
        data.ctrl[self._thrust_actuators] = thrusts
        jolts = JoltWatch(len(wheel_speeds), gravity=self._world.gravity, time_step_s=_TIME_STEP_S)
        velocity = data.qvel[self._free_dofs]
        for row in wheel_speeds:
            if len(self._hinge_wheels):
                data.ctrl[self._hinge_actuators] = self._hinge_targets(row)
            mujoco.mj_step(model, data)
            before, velocity = velocity, data.qvel[self._free_dofs]
            if jolts.wants_reading(velocity - before):
                jolts.take(self._read_contacts())
        self._limit_spin()
        self._contacts = jolts.mean()
        self._tensions = self._read_tensions()
        # A step leaves the kinematics of its beginning behind; bring them up to its end.
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)

    def contacts(self) -> ContactForces:
        return self._contacts

    def rope_tensions(self) -> FloatArray:
        return self._tensions

    def motion(self) -> Motion:
        data, bodies = self._data, self._bodies
        rotation = data.xmat[bodies].reshape(-1, 3, 3) @ self._axes.transpose(0, 2, 1)
        center = data.xipos[bodies]
        spin = data.cvel[bodies, :3]
        anchor = data.subtree_com[self._model.body_rootid[bodies]]
        return Motion(
            position=center - turned(rotation, self._clusters.center_of_mass),
            rotation=rotation,
            velocity=data.cvel[bodies, 3:] + cross(spin, center - anchor),
            spin=spin.copy(),
        )

    def cargo(self) -> CargoPose:
        qpos, qvel = self._data.qpos, self._data.qvel
        return CargoPose(
            position=qpos[:3].copy(), quaternion=qpos[3:7].copy(), velocity=qvel[:3].copy()
        )

    def close(self) -> None:
        del self._data, self._model

    # Building

    def _empty_spec(self) -> "mujoco.MjSpec":
        spec = mujoco.MjSpec()
        option = spec.option
        option.timestep = _TIME_STEP_S
        option.gravity = (0.0, 0.0, -self._world.gravity)
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = _IMPRATIO
        option.iterations = _ITERATIONS
        option.tolerance = 1e-10
        spec.compiler.degree = False
        spec.compiler.autolimits = True
        return spec

    def _add_geom(
        self, body: object, *, name: str, friction: float, priority: int, **shape: object
    ) -> None:
        body.add_geom(
            name=name,
            friction=(friction, 0.005, 0.0001),
            priority=priority,
            condim=3,
            solref=_SOLREF,
            solimp=_SOLIMP,
            **shape,
        )

    def _add_static(self, spec: "mujoco.MjSpec") -> None:
        terrain = {"friction": FRICTION_TERRAIN, "priority": _TERRAIN_PRIORITY}
        if self._world.ground:
            self._add_geom(
                spec.worldbody,
                name="ground",
                type=mujoco.mjtGeom.mjGEOM_PLANE,
                size=(0.0, 0.0, 1.0),
                **terrain,
            )
        for i, box in enumerate(self._world.terrain):
            self._add_geom(
                spec.worldbody,
                name=f"terrain {i}",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=np.array(box.size) / 2,
                pos=box.center,
                **terrain,
            )

    def _add_cargo(self, spec: "mujoco.MjSpec") -> None:
        cargo = self._world.cargo
        if cargo is None:
            return
        a, b, c = cargo.size
        mass = self._cargo_mass
        body = spec.worldbody.add_body(
            name="cargo",
            pos=cargo.position,
            mass=mass,
            inertia=mass / 12 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2]),
            ipos=(0.0, 0.0, 0.0),
            iquat=(1.0, 0.0, 0.0, 0.0),
            explicitinertial=True,
        )
        body.add_freejoint()
        self._add_geom(
            body,
            name="cargo",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=cargo.size / 2,
            friction=FRICTION_TERRAIN,
            priority=_CARGO_PRIORITY,
        )

    def _add_clusters(self, spec: "mujoco.MjSpec", motion: Motion) -> None:
        clusters = self._clusters
        centers = motion.centers_of_mass(clusters)
        world_from_body = motion.rotation @ self._axes
        made: list[object] = []
        for c, parent in enumerate(clusters.parent):
            if parent < 0:
                origin, turn = centers[c], world_from_body[c]
                up = spec.worldbody
            else:
                to_parent = world_from_body[parent].T
                origin = to_parent @ (centers[c] - centers[parent])
                turn = to_parent @ world_from_body[c]
                up = made[parent]
            body = up.add_body(
                name=f"cluster {c}",
                pos=origin,
                quat=quaternion_of(turn),
                mass=clusters.mass[c],
                inertia=self._moments[c],
                ipos=(0.0, 0.0, 0.0),
                iquat=(1.0, 0.0, 0.0, 0.0),
                explicitinertial=True,
            )
            made.append(body)
            if parent < 0:
                body.add_freejoint(name=f"free {c}")
            else:
                self._add_hinge(spec, body, c)
            self._add_blocks(spec, body, c)
        for piece in clusters.pieces:
            for i, first in enumerate(piece):
                for second in piece[i + 1 :]:
                    spec.add_exclude(bodyname1=f"cluster {first}", bodyname2=f"cluster {second}")

    def _add_hinge(self, spec: "mujoco.MjSpec", body: object, c: int) -> None:
        wheel = self._clusters.wheel[c]
        body.add_joint(
            name=f"hinge {c}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            pos=self._in_body(c, self._structure.positions[wheel]),
            axis=self._axes[c].T @ self._structure.directions[wheel],
            armature=0.01,
        )
        servo = spec.add_actuator(
            name=f"hinge {c}", target=f"hinge {c}", trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        gain = _SERVO_GAIN_PER_TORQUE * self._torque
        servo.gainprm[0] = gain
        servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        servo.biasprm[2] = -gain
        servo.forcelimited = True
        servo.forcerange = (-self._torque, self._torque)

    def _add_blocks(self, spec: "mujoco.MjSpec", body: object, c: int) -> None:
        for i in self._clusters.blocks[c]:
            part = self._structure.parts[i]
            is_wheel = part.role is Role.WHEEL
            for k, shape in enumerate(part.shapes):
                half = shape.half_extents
                is_round = shape.kind is ShapeKind.CYLINDER
                self._add_geom(
                    body,
                    name=f"block {i} {k}",
                    type=mujoco.mjtGeom.mjGEOM_CYLINDER if is_round else mujoco.mjtGeom.mjGEOM_BOX,
                    size=(half[0], half[2], 0.0) if is_round else half - COLLISION_MARGIN,
                    pos=self._in_body(c, shape.center),
                    quat=quaternion_of(self._axes[c].T @ shape.rotation),
                    friction=FRICTION_WHEEL if is_wheel else FRICTION_BLOCK,
                    priority=_WHEEL_PRIORITY if is_wheel else _BLOCK_PRIORITY,
                )
            if part.role is Role.CANNON:
                self._add_cannon(spec, body, c, i)

    def _add_cannon(self, spec: "mujoco.MjSpec", body: object, c: int, block: int) -> None:
        structure = self._structure
        body.add_site(name=f"cannon {block}", pos=self._in_body(c, structure.shown[block]))
        recoil = self._axes[c].T @ -structure.directions[block]
        spec.add_actuator(
            name=f"cannon {block}",
            target=f"cannon {block}",
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            gear=(*recoil, 0.0, 0.0, 0.0),
        )

    def _add_ropes(self, spec: "mujoco.MjSpec") -> None:
        ropes, of = self._structure.ropes, self._clusters.cluster_of
        for r in np.flatnonzero(self._rope_alive):
            ends = (
                (ropes.first[r], ropes.first_point[r]),
                (ropes.second[r], ropes.second_point[r]),
            )
            tendon = spec.add_tendon(
                name=f"rope {r}", limited=True, range=(0.0, ropes.length[r]), solref_limit=_SOLREF
            )
            for k, (block, point) in enumerate(ends):
                c = of[block]
                spec.body(f"cluster {c}").add_site(
                    name=f"rope {r} {k}", pos=self._in_body(c, point)
                )
                tendon.wrap_site(f"rope {r} {k}")

    def _in_body(self, c: int, point: FloatArray) -> FloatArray:
        """A machine-frame point in the frame of a cluster's body."""
        return np.asarray(self._axes[c].T @ (point - self._clusters.center_of_mass[c]))

    def _find_addresses(self) -> None:
        model, clusters = self._model, self._clusters
        self._bodies = np.array([model.body(f"cluster {c}").id for c in range(len(clusters))])
        self._block_of_geom = np.full(model.ngeom, -1)
        for i, part in enumerate(self._structure.parts):
            for k in range(len(part.shapes)):
                self._block_of_geom[model.geom(f"block {i} {k}").id] = i
        hinged = np.flatnonzero(clusters.parent >= 0)
        place = {int(wheel): w for w, wheel in enumerate(self._structure.wheels)}
        self._hinge_wheels = np.array([place[int(clusters.wheel[c])] for c in hinged], dtype=int)
        self._hinge_signs = np.where(clusters.wheel_is_outer[hinged], 1.0, -1.0)
        self._hinge_actuators = np.array(
            [model.actuator(f"hinge {c}").id for c in hinged], dtype=int
        )
        self._thrust_actuators = np.array(
            [model.actuator(f"cannon {i}").id for i in self._structure.cannons], dtype=int
        )
        free = [model.joint(f"free {piece[0]}").dofadr[0] for piece in clusters.pieces]
        self._free_dofs = np.array(free)[:, None] + np.arange(3)
        if self._world.cargo is not None:
            self._free_dofs = np.concatenate([np.arange(3)[None], self._free_dofs])
        self._spin_dofs = np.array(free)[:, None] + np.arange(3, 6)
        self._tendon_of = {
            int(r): model.tendon(f"rope {r}").id for r in np.flatnonzero(self._rope_alive)
        }
        if self._world.cargo is not None:
            self._cargo_body = model.body("cargo").id
            self._cargo_unit_inertia = model.body_inertia[self._cargo_body] / self._cargo_mass
            self._cargo_unit_invweight = model.body_invweight0[self._cargo_body] * self._cargo_mass
            self._cargo_unit_dof_invweight = model.dof_invweight0[:6] * self._cargo_mass

    def _set_drag(self) -> None:
        """Damping of each piece's free joint: Unity's v *= 1 - drag·dt, told as a force."""
        model, clusters = self._model, self._clusters
        for piece in clusters.pieces:
            dof = model.joint(f"free {piece[0]}").dofadr[0]
            inside = list(piece)
            model.dof_damping[dof : dof + 3] = clusters.linear_drag[inside] @ clusters.mass[inside]
            model.dof_damping[dof + 3 : dof + 6] = (
                clusters.angular_drag[piece[0]] * self._moments[piece[0]]
            )

    def _set_velocities(self, motion: Motion) -> None:
        model, data, clusters = self._model, self._data, self._clusters
        if self._cargo_state is not None:
            data.qpos[:7], data.qvel[:6] = self._cargo_state
        for c, parent in enumerate(clusters.parent):
            if parent < 0:
                dof = model.joint(f"free {c}").dofadr[0]
                data.qvel[dof : dof + 3] = motion.velocity[c]
                world_from_body = motion.rotation[c] @ self._axes[c]
                data.qvel[dof + 3 : dof + 6] = world_from_body.T @ motion.spin[c]
            else:
                axis = motion.rotation[c] @ self._structure.directions[clusters.wheel[c]]
                rate = (motion.spin[c] - motion.spin[parent]) @ axis
                data.qvel[model.joint(f"hinge {c}").dofadr[0]] = rate

    # Stepping

    def _hinge_targets(self, speeds: FloatArray) -> FloatArray:
        return np.asarray(speeds[self._hinge_wheels] * self._hinge_signs)

    def _limit_spin(self) -> None:
        """Slows pieces that spin faster than any part of the game may."""
        spins = self._data.qvel[self._spin_dofs]
        speeds = np.sqrt((spins * spins).sum(axis=1))
        if speeds.max(initial=0.0) > MAX_SPIN:
            scale = np.minimum(1.0, MAX_SPIN / np.maximum(speeds, 1e-9))
            self._data.qvel[self._spin_dofs] = spins * scale[:, None]

    def _read_contacts(self) -> ContactForces:
        data = self._data
        contact, count = data.contact, data.ncon
        address = contact.efc_address[:count]
        active = np.flatnonzero(address >= 0)
        geoms = contact.geom[active]
        blocks = self._block_of_geom[geoms]
        address = address[active]
        components = data.efc_force[address[:, None] + np.arange(3)]
        frames = contact.frame[active].reshape(-1, 3, 3)
        # MuJoCo's contact force acts on the second geom.
        force = turned(frames.transpose(0, 2, 1), components)
        point, normal = contact.pos[active], frames[:, 0]
        bodies = self._model.geom_bodyid[geoms]
        first, second = blocks[:, 0] >= 0, blocks[:, 1] >= 0
        block = np.concatenate([blocks[first, 0], blocks[second, 1]])
        return ContactForces(
            block=block,
            other=np.concatenate([bodies[first, 1], bodies[second, 0]]),
            weight=np.ones(len(block)),
            normal=np.concatenate([-normal[first], normal[second]]),
            point=np.concatenate([point[first], point[second]]),
            force=np.concatenate([-force[first], force[second]]),
        )

    def _read_tensions(self) -> FloatArray:
        tensions = np.zeros(len(self._rope_alive))
        if not self._tendon_of:
            return tensions
        data = self._data
        limits = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON
        rows = {int(data.efc_id[k]): k for k in np.flatnonzero(limits)}
        for r, tendon in self._tendon_of.items():
            if tendon in rows:
                tensions[r] = data.efc_force[rows[tendon]]
        return tensions
