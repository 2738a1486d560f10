"""PyBullet behind the engine seam: one multibody per articulated component, read from URDF text.

Why: multibodies keep heavy cargo quiet; `createCollisionShapeArray` drops shapes beyond 16; inertia
computed by PyBullet is wrong; URDFs are cached by file name; its damping grows with the speed's
square, so drag is a force of ours.
"""

import itertools
import math
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from buildarena_simulation.constants import FORCES_EVERY_S
from buildarena_simulation.engines.base import (
    CargoPose,
    World,
    principal_frames,
    quaternion_of,
    rotation_of,
)
from buildarena_simulation.engines.pybullet.bodies import (
    RESIDUAL,
    follow_friction,
    free_of_damping,
    friction_of,
    limit_spin,
    load_body,
    mixed_clusters,
    pose_of,
    push_cargo,
    put_cargo,
    set_friction,
    set_time_step,
    start_world,
)
from buildarena_simulation.engines.pybullet.contacts import read_contacts
from buildarena_simulation.engines.pybullet.external_forces import (
    Force,
    body_wrenches,
    drag_forces,
    thrust_forces,
)
from buildarena_simulation.engines.pybullet.grips import BulletGrips
from buildarena_simulation.engines.pybullet.hinges import HingedComponent, hinge_frames
from buildarena_simulation.engines.pybullet.joints import articulated
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.engines.pybullet.ropes import pull_ends, rope_forces
from buildarena_simulation.engines.pybullet.slipping import SlippingWheels, changes_of
from buildarena_simulation.engines.pybullet.urdf import urdf_of
from buildarena_simulation.engines.pybullet.version import version
from buildarena_simulation.engines.shared.closest_points import shape_table
from buildarena_simulation.engines.shared.impacts import ImpactWatch
from buildarena_simulation.engines.shared.joint_frames import (
    has_joints,
    is_simple_component,
    joint_rate,
)
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import CARGO, ContactForces
from buildarena_simulation.structure.grips import Hold
from buildarena_simulation.structure.model import FloatArray
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.solids import Solids

# It greets when it is imported, on streams where our own output may be JSON.
with quiet_output():
    import pybullet

__all__ = ["PyBulletEngine", "create", "version"]

_TIME_STEP_S = 1 / 500
_STEPS_PER_EVALUATION = 20
_ITERATIONS, _ITERATIONS_OF_JOINTS = 100, 60
_ORIGIN = (0.0, 0.0, 0.0)


def create(world: World) -> "PyBulletEngine":
    """Create a PyBullet world with everything except the machine."""
    return PyBulletEngine(world)


class PyBulletEngine:
    """A PyBullet world; see `Engine` for what its methods mean."""

    def __init__(self, world: World) -> None:
        self._world, self._finer = world, 1
        self._structure = world.structure
        self._rope_alive = np.ones(len(world.structure.ropes), dtype=bool)
        self._tensions = np.zeros(len(world.structure.ropes))
        self._place_of_wheel = {int(i): w for w, i in enumerate(world.structure.wheels)}
        self._targets: FloatArray | None = None
        self._mass = float(world.structure.masses.sum())
        self._cargo_mass = world.cargo.mass if world.cargo else 0.0
        self._iterations = _ITERATIONS_OF_JOINTS if has_joints(world.structure) else _ITERATIONS
        self._number = pybullet.connect(pybullet.DIRECT)
        self._client = {"physicsClientId": self._number}
        self._folder = Path(tempfile.mkdtemp(prefix="buildarena-"))
        self._serial = itertools.count()
        self._components: list[HingedComponent] = []
        self._solids = Solids(world.structure)
        self._surfaces, self._cargo = start_world(
            self._client, world, time_step_s=self.time_step_s, iterations=self._iterations
        )
        self._grips = BulletGrips(self._client)
        self._fresh: Motion | None = None
        self._pose: CargoPose | None = None
        self._own: list[tuple[int, Force]] = []
        self._slipping = SlippingWheels(
            self._client, world.structure, self._surfaces, world.gravity
        )

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
            "iterations": self._iterations,
            "residual": RESIDUAL,
            "cone_friction": 1,
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
        if finer != self._finer:
            self._finer = finer
            set_time_step(self._client, self.time_step_s)
        if cargo is not None and self._cargo is not None:
            put_cargo(self._client, self._cargo, cargo)
            self._pose = None
        self._clusters, self._motion = clusters, motion
        self._axes, self._moments = principal_frames(clusters)
        self._compliance = np.asarray(np.linalg.inv(clusters.inertia))
        self._hinges = hinge_frames(self._structure, clusters, motion)
        self._grips.leave()
        for component in self._components:
            if component.articulation is not None:
                component.articulation.release()
            pybullet.removeBody(component.body, **self._client)
        self._components = [self._add_component(inside, motion) for inside in clusters.components]
        self._cluster_of_link = {
            (tree.body, link): c for tree in self._components for c, link in tree.links.items()
        }
        self._address = {c: key for key, c in self._cluster_of_link.items()}
        self._shapes = [shape_table(self._structure, blocks) for blocks in clusters.blocks]
        self._free_bodies = [component.body for component in self._components]
        if self._cargo is not None:
            self._free_bodies.append(self._cargo)
        mixed = mixed_clusters(self._structure, clusters)
        self._mixed = {c: self._address[c] for c in mixed}
        self._slipping.enter(clusters, self._address, self.time_step_s)
        self._grips.enter(clusters, motion, self._axes, self._address, self._cargo)

    def set_cargo_mass(self, mass: float) -> None:
        """See `Engine`."""
        self._cargo_mass = mass
        pybullet.changeDynamics(self._cargo, -1, mass=mass, **self._client)

    def blow(self, wind: FloatArray) -> None:
        """See `Engine`."""
        east, north = wind[:2].tolist()
        pybullet.setGravity(east, north, -self._world.gravity, **self._client)

    def push_cargo(self, change: FloatArray) -> None:
        """See `Engine`."""
        if self._cargo is not None:
            push_cargo(self._client, self._cargo, change)
            self._pose = None

    def drop_rope(self, index: int) -> None:
        """See `Engine`."""
        self._rope_alive[index] = False
        self._tensions[index] = 0.0

    def advance(self, targets: FloatArray, thrusts: FloatArray, *, watched: bool = True) -> None:
        """See `Engine`."""
        external_forces = thrust_forces(self._structure, self._clusters, self._axes, thrusts)
        drags: list[tuple[int, Force]] = []
        if self._world.planet is None:
            bodies = self._structure, self._clusters, self._motion
            drags = drag_forces(*bodies, self._axes, self._moments)
        impacts = ImpactWatch(
            len(targets),
            gravity=self._world.gravity if watched else math.inf,
            time_step_s=self.time_step_s,
            mass=self._mass + self._cargo_mass,
        )
        velocity, roped = self._free_velocities(), bool(self._rope_alive.any())
        changes = changes_of(self._targets, targets)
        for step, (row, change) in enumerate(zip(targets, changes, strict=True)):
            if len(row) and (step == 0 or change != 0.0):
                for component in self._components:
                    component.follow(row, self._client)
            self._apply_forces(external_forces, [*drags, *self._own_forces(step)])
            if roped:
                self._pull_ropes()
            self._slipping.push(step, change)
            if step + 1 == len(targets):
                impacts.before_last(*self._step_contacts())
            pybullet.stepSimulation(self._number)
            before, velocity = velocity, self._free_velocities()
            if impacts.is_impact(before, velocity):
                self._motion = self._read_motion()
                impacts.take(self._step_contacts()[1]())
        self._targets, self._pose = targets[-1], None
        self._motion = self._read_motion()
        pressed, self._last_contacts = self._step_contacts()
        if impacts.ends_in_blow(pressed):
            impacts.take(self._last_contacts())
        limit_spin(self._client, self._components, self._motion)
        if self._mixed:
            follow_friction(self._client, self._structure, self._mixed, self._shapes, self._motion)
        self._impacts = impacts

    def contacts(self) -> ContactForces:
        """See `Engine`."""
        return self._impacts.mean(self._last_contacts)

    @property
    def struck(self) -> bool:
        """See `Engine`."""
        return self._impacts.struck

    def hold(self, holds: Sequence[Hold]) -> None:
        """See `Engine`."""
        self._grips.holds = tuple(holds)

    def grip_wrenches(self) -> FloatArray:
        """See `Engine`."""
        return self._grips.wrenches()

    def rope_tensions(self) -> FloatArray:
        """See `Engine`."""
        return self._tensions

    def motion(self) -> Motion:
        """See `Engine`."""
        return self._motion

    def cargo(self) -> CargoPose:
        """See `Engine`."""
        if self._pose is None:
            self._pose = pose_of(self._client, self._cargo)
        return self._pose

    def close(self) -> None:
        """See `Engine`."""
        pybullet.disconnect(**self._client)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _add_component(self, inside: tuple[int, ...], motion: Motion) -> HingedComponent:
        clusters, structure, root = self._clusters, self._structure, inside[0]
        body = self._load(inside, motion)
        free_of_damping(self._client, body)
        velocity, spin = motion.velocity[root].tolist(), motion.spin[root].tolist()
        pybullet.resetBaseVelocity(body, velocity, spin, **self._client)
        articulation = articulated(
            self._world,
            clusters,
            self._axes,
            body=body,
            inside=inside,
            time_step_s=self.time_step_s,
            client=self._client,
        )
        for c, link in articulation.links.items():
            set_friction(self._client, body, link, friction_of(structure, clusters.blocks[c]))
        simple = is_simple_component(structure, clusters, inside)
        if simple:
            for link, c in enumerate(inside[1:]):
                rate = joint_rate(structure, clusters, motion, c)
                pybullet.resetJointState(body, link, 0.0, rate, **self._client)
        else:
            articulation.start(motion, self._targets)
        articulation.add_gears()
        hinged = list(inside[1:]) if simple else []
        places = [self._place_of_wheel[int(wheel)] for wheel in clusters.attached[hinged]]
        return HingedComponent(
            body=body,
            inside=inside,
            links=articulation.links,
            articulation=None if simple else articulation,
            wheel_signs=np.where(clusters.attached_is_outer[hinged], 1.0, -1.0),
            wheel_places=np.array(places, dtype=np.int64),
            wheel_torques=structure.torques[clusters.attached[hinged]] * self._world.drive_unit,
        )

    def _load(self, inside: tuple[int, ...], motion: Motion) -> int:
        """Load the body of a component at its root's pose, and return its id."""
        clusters, root = self._clusters, inside[0]
        solids = {c: self._solids.of(clusters.blocks[c]) for c in inside}
        text = urdf_of(self._structure, clusters, solids, axes=self._axes, moments=self._moments)
        return load_body(
            self._client,
            self._folder / f"{next(self._serial)}.urdf",
            text,
            motion.centers_of_mass(clusters)[root],
            quaternion_of(motion.rotation[root] @ self._axes[root]),
        )

    def _apply_forces(
        self, thrusts: list[tuple[int, Force]], drags: list[tuple[int, Force]]
    ) -> None:
        frame, number, address = pybullet.LINK_FRAME, self._number, self._address
        for c, (force, point) in thrusts:
            pybullet.applyExternalForce(*address[c], force, point, frame, number)
        for c, (force, torque) in drags:
            pybullet.applyExternalForce(*address[c], force, _ORIGIN, frame, number)
            pybullet.applyExternalTorque(*address[c], torque, frame, number)

    def _own_forces(self, step: int) -> list[tuple[int, Force]]:
        field = self._world.field
        if field is not None and step % round(FORCES_EVERY_S / self.time_step_s) == 0:
            # Ropes ask for the same motion in this step.
            self._fresh = motion = self._read_motion()
            self._own = body_wrenches(field.wrenches(self._clusters, motion), self._axes)
        return self._own

    def _pull_ropes(self) -> None:
        structure, clusters = self._structure, self._clusters
        motion, field = self._fresh or self._read_motion(), self._world.field
        self._fresh = None
        pulls = rope_forces(
            structure,
            clusters,
            motion,
            compliance=self._compliance,
            alive=self._rope_alive,
            rest_lengths=structure.ropes.length if field is None else field.rest_lengths(),
            time_step_s=self.time_step_s,
        )
        self._tensions = pulls.tension
        pull_ends(self._client, pulls.forces, clusters, self._address)

    def _free_velocities(self) -> list[float]:
        """Return the velocity of every component and of the cargo, units/s."""
        ask, number = pybullet.getBaseVelocity, self._number
        return [rate for body in self._free_bodies for rate in ask(body, number)[0]]

    def _read_motion(self) -> Motion:
        """Return the poses and velocities of all clusters, children's by their hinges' angles."""
        clusters, client = self._clusters, self._client
        count = len(clusters)
        motion = Motion(
            position=np.empty((count, 3)),
            rotation=np.empty((count, 3, 3)),
            velocity=np.empty((count, 3)),
            spin=np.empty((count, 3)),
        )
        for component in self._components:
            root, body = component.inside[0], component.body
            center, turn = pybullet.getBasePositionAndOrientation(body, **client)
            motion.velocity[root], motion.spin[root] = pybullet.getBaseVelocity(body, **client)
            rotation = rotation_of(np.array(turn)[[3, 0, 1, 2]]) @ self._axes[root].T
            motion.rotation[root] = rotation
            motion.position[root] = center - rotation @ clusters.center_of_mass[root]
            hinged = component.inside[1:]
            if component.articulation is not None:
                component.articulation.read(motion)
            elif hinged:
                states = pybullet.getJointStates(body, range(len(hinged)), **client)
                for c, state in zip(hinged, states, strict=True):
                    self._hinges.follow(motion, c, state[0], state[1])
        return motion

    def _step_contacts(self) -> tuple[float, Callable[[], ContactForces]]:
        """Return the sum of the last step's normal forces, and a reader of its contacts."""
        touching, added = pybullet.getContactPoints(**self._client), self._slipping.contacts()
        return sum(contact[9] for contact in touching), lambda: read_contacts(
            touching,
            self._cluster_of_link,
            self._shapes,
            self._motion,
            outsiders={} if self._cargo is None else {self._cargo: CARGO},
            surfaces=self._surfaces,
            added=added,
        )
