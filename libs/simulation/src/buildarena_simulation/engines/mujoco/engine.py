"""MuJoCo behind the engine seam: one body per cluster, one geom per block, hinges for axles."""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import mujoco
import numpy as np

from buildarena_simulation.constants import FORCES_EVERY_S, MAX_SPIN
from buildarena_simulation.engines.base import CargoPose, World, principal_frames, rotation_of
from buildarena_simulation.engines.mujoco.addresses import addresses_in
from buildarena_simulation.engines.mujoco.contacts import ContactReader, StepContacts, step_contacts
from buildarena_simulation.engines.mujoco.joints import drag_apart, enter_joint
from buildarena_simulation.engines.mujoco.model import MjcfSettings, MjcfState, mjcf_of
from buildarena_simulation.engines.mujoco.tendons import Tendons, hold_as_they_are, weld_wrenches
from buildarena_simulation.engines.mujoco.wheels import wheel_contacts
from buildarena_simulation.engines.shared.impacts import ImpactWatch
from buildarena_simulation.engines.shared.joint_frames import is_simple_component
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.grips import Hold
from buildarena_simulation.structure.model import FloatArray
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.solids import Solids
from buildarena_simulation.structure.vectors import cross, turned, turned_wrenches

_TIME_STEP_S = 1 / 500
_STEPS_PER_EVALUATION = 20
_SOLREF = (0.02, 1.0)
_FRICTION_S = 0.03
_SOLIMP = (0.95, 0.995, 0.005, 0.5, 2.0)
_IMPRATIO = 1e4
_ITERATIONS = 50


def _ignore(message: str) -> None:
    """Discard MuJoCo's warnings, which it writes to a file; a blow-up is detected anyway."""


mujoco.set_mju_user_warning(_ignore)


def version() -> str:
    """Return the version of the MuJoCo library."""
    return str(mujoco.__version__)


def create(world: World) -> "MujocoEngine":
    """Create a MuJoCo world with everything except the machine."""
    return MujocoEngine(world)


class MujocoEngine:
    """A MuJoCo world; see `Engine` for what its methods mean."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._structure = world.structure
        self._finer = 1
        self._solids = Solids(world.structure)
        self._holds: tuple[Hold, ...] = ()
        self._rope_alive = np.ones(len(world.structure.ropes), dtype=bool)
        self._mass = float(world.structure.masses.sum())
        self._cargo_mass = world.cargo.mass if world.cargo else 0.0
        self._cargo_state: tuple[FloatArray, FloatArray] | None = None
        self._targets: FloatArray | None = None
        self._wind = np.zeros(3)
        self._motion: Motion | None = None
        self._cargo_pose: CargoPose | None = None

    @property
    def time_step_s(self) -> float:
        """See `Engine`."""
        return _TIME_STEP_S / (self._world.substeps * self._finer)

    @property
    def steps_per_evaluation(self) -> int:
        """See `Engine`."""
        return _STEPS_PER_EVALUATION * self._world.substeps

    @property
    def settings(self) -> Mapping[str, float | int | str]:
        """See `Engine`."""
        return {
            "time_step_s": self.time_step_s,
            "steps_per_evaluation": self.steps_per_evaluation,
            "integrator": "implicitfast",
            "cone": "elliptic",
            "impratio": _IMPRATIO,
            "iterations": _ITERATIONS,
            "solref": str(_SOLREF),
            "friction_s": _FRICTION_S,
            "solimp": str(_SOLIMP),
        }

    def enter(
        self,
        clusters: Clusters,
        motion: Motion,
        *,
        cargo: CargoPose | None = None,
        finer: int = 1,
    ) -> None:
        """See `Engine`."""
        self._clusters, self._finer = clusters, finer
        if cargo is not None:
            spin = rotation_of(cargo.quaternion).T @ cargo.spin
            self._cargo_state = (
                np.concatenate([cargo.position, cargo.quaternion]),
                np.concatenate([cargo.velocity, spin]),
            )
        self._axes, moments = principal_frames(clusters)
        solids = [self._solids.of(blocks) for blocks in clusters.blocks]
        state = MjcfState(
            clusters=clusters,
            motion=motion,
            solids=solids,
            axes=self._axes,
            moments=moments,
            cargo_mass=self._cargo_mass,
            ropes=np.flatnonzero(self._rope_alive).tolist(),
            holds=self._holds,
        )
        self._model = mujoco.MjModel.from_xml_string(mjcf_of(self._world, state, self._settings()))
        self._model.opt.gravity[:2] = self._wind[:2]
        self._data = mujoco.MjData(self._model)
        self._addresses = addresses_in(self._model, self._world, clusters, solids, self._rope_alive)
        self._tendons = Tendons(
            model=self._model,
            data=self._data,
            ropes=self._structure.ropes,
            of=self._addresses.tendons,
        )
        self._roots = self._model.body_rootid[self._addresses.bodies]
        self._reader = ContactReader(self._structure, clusters, self._addresses)
        if self._world.cargo is not None:
            self._cargo_body = self._model.body("cargo").id
            self._scale_cargo_by_mass()
        self._set_drag(moments)
        self._set_velocities(motion)
        hold_as_they_are(self._model, self._data, self._holds)
        mujoco.mj_forward(self._model, self._data)
        self._motion = self._cargo_pose = None
        wheels = len(self._structure.wheels)
        self._wheels = wheel_contacts(
            self._model, self._data, wheels, friction_s=_FRICTION_S, gravity=self._world.gravity
        )
        self._wheels.support(self._model, self._mass + self._cargo_mass)

    def set_cargo_mass(self, mass: float) -> None:
        """See `Engine`."""
        body, model = self._cargo_body, self._model
        model.body_mass[body] = mass
        model.body_subtreemass[body] = mass
        model.body_inertia[body] = self._inertia_per_mass * mass
        # A free body by itself takes its inertia from here, computed once and never again.
        model.dof_M0[:3] = mass
        model.dof_M0[3:6] = model.body_inertia[body]
        # The solver scales contact softness by these; for a free body they go with 1 / mass.
        model.body_invweight0[body] = self._invweight_times_mass / mass
        model.dof_invweight0[:6] = self._dof_invweight_times_mass / mass
        self._cargo_mass = mass
        self._wheels.support(model, self._mass + mass)

    def push_cargo(self, change: FloatArray) -> None:
        """See `Engine`."""
        self._data.qvel[:3] += change
        self._keep_cargo_state()

    def blow(self, wind: FloatArray) -> None:
        """See `Engine`."""
        self._wind = wind
        self._model.opt.gravity[:2] = wind[:2]

    def drop_rope(self, index: int) -> None:
        """See `Engine`."""
        self._rope_alive[index] = False
        self._tendons.drop(index)

    def advance(self, targets: FloatArray, thrusts: FloatArray, *, watched: bool = True) -> None:
        """See `Engine`."""
        model, data, at = self._model, self._data, self._addresses
        self._targets = targets[-1]
        if self._apart:
            drag_apart(model, data, (self._clusters, at.bodies), self.motion(), self._apart)
        data.ctrl[at.thrust_actuators] = thrusts
        impacts = ImpactWatch(
            len(targets),
            gravity=self._world.gravity if watched else math.inf,
            time_step_s=self.time_step_s,
            mass=self._mass + self._cargo_mass,
        )
        # A view, which the steps write to.
        rates, free = data.qvel, at.free_dofs
        velocity, last = rates.take(free).tolist(), len(targets) - 1
        exerts = self._world.field is not None
        if self._world.field is not None:
            self._tendons.set_lengths(self._world.field.rest_lengths())
        for step, row in enumerate(targets):
            if exerts:
                self._apply_own_forces(step)
            at.joints.follow(model, data, row)
            if step == last:
                contacts = step_contacts(data)
                impacts.before_last(contacts.pressed, partial(self._contacts_of, contacts))
            mujoco.mj_step(model, data)
            before, velocity = velocity, rates.take(free).tolist()
            if impacts.is_impact(before, velocity):
                self._motion = None
                impacts.take(self._contacts_of(step_contacts(data)))
        self._motion = None
        self._last_contacts = step_contacts(data)
        if impacts.ends_in_blow(self._last_contacts.pressed):
            impacts.take(self._contacts_of(self._last_contacts))
        self._limit_spin()
        self._keep_cargo_state()
        self._impacts = impacts
        self._tensions = self._tendons.tensions()
        self._bring_up()

    def contacts(self) -> ContactForces:
        """See `Engine`."""
        return self._impacts.mean(lambda: self._contacts_of(self._last_contacts))

    @property
    def struck(self) -> bool:
        """See `Engine`."""
        return self._impacts.struck

    def hold(self, holds: Sequence[Hold]) -> None:
        """See `Engine`."""
        self._holds = tuple(holds)

    def grip_wrenches(self) -> FloatArray:
        """See `Engine`."""
        return weld_wrenches(self._model, self._data, self._holds)

    def rope_tensions(self) -> FloatArray:
        """See `Engine`."""
        return self._tensions

    def motion(self) -> Motion:
        """See `Engine`."""
        if self._motion is None:
            self._motion = self._read_motion()
        return self._motion

    def _read_motion(self) -> Motion:
        data, bodies = self._data, self._addresses.bodies
        rotation = data.xmat.take(bodies, 0).reshape(-1, 3, 3) @ self._axes.transpose(0, 2, 1)
        center, rates = data.xipos.take(bodies, 0), data.cvel.take(bodies, 0)
        anchor, spin = data.subtree_com.take(self._roots, 0), rates[:, :3]
        return Motion(
            position=center - turned(rotation, self._clusters.center_of_mass),
            rotation=rotation,
            velocity=rates[:, 3:] + cross(spin, center - anchor),
            spin=spin,
        )

    def cargo(self) -> CargoPose:
        """See `Engine`."""
        if self._cargo_pose is None:
            place, rates = self._data.qpos[:7].copy(), self._data.qvel[:6].copy()
            self._cargo_pose = CargoPose(
                position=place[:3],
                quaternion=place[3:],
                velocity=rates[:3],
                spin=rotation_of(place[3:]) @ rates[3:],
            )
        return self._cargo_pose

    def close(self) -> None:
        """See `Engine`."""
        del self._tendons, self._data, self._model

    def _settings(self) -> MjcfSettings:
        return MjcfSettings(
            time_step_s=self.time_step_s,
            solref=_SOLREF,
            friction_s=_FRICTION_S,
            solimp=_SOLIMP,
            impratio=_IMPRATIO,
            iterations=_ITERATIONS,
        )

    def _apply_own_forces(self, step: int) -> None:
        field, every = self._world.field, round(FORCES_EVERY_S / self.time_step_s)
        if field is None or step % every:
            return
        if step:
            self._bring_up()
        motion, data = self.motion(), self._data
        wrenches = field.wrenches(self._clusters, motion)
        data.xfrc_applied[self._addresses.bodies] = turned_wrenches(motion.rotation, wrenches)

    def _bring_up(self) -> None:
        """Update the kinematics, which MuJoCo leaves at the start of the last step, to its end."""
        self._motion = None
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)

    def _keep_cargo_state(self) -> None:
        self._cargo_pose = None
        if self._world.cargo is not None:
            self._cargo_state = (self._data.qpos[:7].copy(), self._data.qvel[:6].copy())

    def _scale_cargo_by_mass(self) -> None:
        body, model, mass = self._cargo_body, self._model, self._cargo_mass
        self._inertia_per_mass = model.body_inertia[body] / mass
        self._invweight_times_mass = model.body_invweight0[body] * mass
        self._dof_invweight_times_mass = model.dof_invweight0[:6] * mass

    def _set_drag(self, moments: FloatArray) -> None:
        """Set the damping of each component's free joint: Unity's v *= 1 - drag·dt, as a force.

        The clusters of a component with other joints than wheels' axles have each its own drag.
        """
        model, clusters = self._model, self._clusters
        self._apart: list[tuple[int, ...]] = []
        for component in clusters.components:
            if self._world.planet is not None:
                break  # the field has drag and gravity
            if not is_simple_component(self._structure, clusters, component):
                self._apart.append(component)
                continue
            root, inside = component[0], list(component)
            dof = model.joint(f"free {root}").dofadr[0]
            drag = clusters.linear_drag[inside] @ clusters.mass[inside]
            model.dof_damping[dof : dof + 3] = drag
            model.dof_damping[dof + 3 : dof + 6] = clusters.angular_drag[root] * moments[root]

    def _set_velocities(self, motion: Motion) -> None:
        model, data, clusters = self._model, self._data, self._clusters
        if self._cargo_state is not None:
            data.qpos[:7], data.qvel[:6] = self._cargo_state
        bodies = (self._structure, clusters, self._axes)
        for c, parent in enumerate(clusters.parent):
            if parent < 0:
                dof = model.joint(f"free {c}").dofadr[0]
                data.qvel[dof : dof + 3] = motion.velocity[c]
                world_from_body = motion.rotation[c] @ self._axes[c]
                data.qvel[dof + 3 : dof + 6] = world_from_body.T @ motion.spin[c]
            else:
                enter_joint(model, data, bodies, motion, c=c, targets=self._targets)

    def _limit_spin(self) -> None:
        """Slow components that spin faster than any part of the game may."""
        dofs = self._addresses.spin_dofs
        spins = self._data.qvel[dofs]
        if np.abs(spins).max() > MAX_SPIN / 2:
            speeds = np.sqrt((spins * spins).sum(axis=1))
            scale = np.minimum(1.0, MAX_SPIN / np.maximum(speeds, 1e-9))
            self._data.qvel[dofs] = spins * scale[:, None]

    def _contacts_of(self, contacts: StepContacts) -> ContactForces:
        return self._reader.forces(contacts, self.motion)
