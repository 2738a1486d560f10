"""Bodies of a PyBullet world: boxes, damping and friction."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from buildarena_simulation.constants import FRICTION_TERRAIN, MAX_SPIN
from buildarena_simulation.engines.base import CargoPose, World, quaternion_of
from buildarena_simulation.engines.pybullet.hinges import HingedComponent
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.engines.shared.closest_points import ShapeTable
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.terrain import shape_of

with quiet_output():
    import pybullet

_SPEED_CAP: Final = 1e5
_GROUND_REACH: Final = 2000.0
RESIDUAL: Final = 1e-9
"""Residual at which the solver stops."""


def add_box(
    client: Mapping[str, int],
    half: Sequence[float] | FloatArray,
    center: Sequence[float] | FloatArray,
    *,
    mass: float,
    turn: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
    is_ball: bool = False,
) -> int:
    """Add a box, or a ball, of neutral friction, and return its id.

    Args:
        client: The engine's world.
        half: (3,) half-extents, units.
        center: (3,) world frame, units.
        mass: 0 for one that never moves.
        turn: Quaternion world_from_box (x, y, z, w).
        is_ball: True for a ball, whose radius the half-extents are.
    """
    shape = (
        pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=half[0], **client)
        if is_ball
        else pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, **client)
    )
    body = pybullet.createMultiBody(
        mass,
        shape,
        basePosition=center,
        baseOrientation=turn,
        useMaximalCoordinates=0,
        **client,
    )
    free_of_damping(client, body)
    set_friction(client, body, -1, FRICTION_TERRAIN)
    return int(body)


def free_of_damping(client: Mapping[str, int], body: int) -> None:
    """Remove a body's damping and speed limit; drag is applied as a force."""
    pybullet.changeDynamics(
        body,
        -1,
        linearDamping=0,
        angularDamping=0,
        maxJointVelocity=_SPEED_CAP,
        **client,
    )


def set_friction(client: Mapping[str, int], body: int, link: int, friction: float) -> None:
    """Set the friction coefficient of one link, and remove its bounce."""
    # A separate call: one that also sets damping drops the friction of a link.
    pybullet.changeDynamics(
        body,
        link,
        lateralFriction=friction,
        rollingFriction=0,
        spinningFriction=0,
        restitution=0,
        **client,
    )


def load_body(
    client: Mapping[str, int], file: Path, text: str, center: FloatArray, turn: FloatArray
) -> int:
    """Load a body into the world.

    Args:
        client: The engine's world.
        file: File for its description meanwhile; its name must be unused.
        text: URDF.
        center: (3,) position of its centre of mass, world frame, units.
        turn: (4,) world_from_principal as (w, x, y, z).
    """
    file.write_text(text, encoding="ascii")
    body = pybullet.loadURDF(
        str(file),
        center.tolist(),
        turn[[1, 2, 3, 0]].tolist(),
        flags=pybullet.URDF_USE_INERTIA_FROM_FILE
        | pybullet.URDF_MAINTAIN_LINK_ORDER
        | pybullet.URDF_USE_IMPLICIT_CYLINDER,
        useMaximalCoordinates=0,
        **client,
    )
    file.unlink()
    return int(body)


def pose_of(client: Mapping[str, int], body: int | None) -> CargoPose:
    """Return the pose of a body and the velocity of its centre."""
    position, turn = pybullet.getBasePositionAndOrientation(body, **client)
    velocity, spin = pybullet.getBaseVelocity(body, **client)
    return CargoPose(
        position=np.array(position),
        quaternion=np.array(turn)[[3, 0, 1, 2]],
        velocity=np.array(velocity),
        spin=np.array(spin),
    )


def put_cargo(client: Mapping[str, int], body: int, pose: CargoPose) -> None:
    """Set the pose and velocity of the cargo."""
    turn = pose.quaternion[[1, 2, 3, 0]].tolist()
    pybullet.resetBasePositionAndOrientation(body, pose.position.tolist(), turn, **client)
    pybullet.resetBaseVelocity(body, pose.velocity.tolist(), pose.spin.tolist(), **client)


def push_cargo(client: Mapping[str, int], body: int, change: FloatArray) -> None:
    """Change the velocity of the cargo's centre by (3,), units/s."""
    pose = pose_of(client, body)
    put_cargo(client, body, replace(pose, velocity=pose.velocity + change))


def set_time_step(client: Mapping[str, int], time_step_s: float) -> None:
    """Set the length of a step, seconds."""
    pybullet.setPhysicsEngineParameter(fixedTimeStep=time_step_s, **client)


def start_world(
    client: Mapping[str, int], world: World, *, time_step_s: float, iterations: int
) -> tuple[dict[int, int], int | None]:
    """Set a new world's gravity and solver, and add ground, terrain and cargo.

    Args:
        client: The engine's world.
        time_step_s: Length of a step, seconds.
        iterations: Maximum iterations of the solver.

    Returns:
        The number of each fixed body in `ContactForces.surface`, and the cargo's body.
    """
    pybullet.setGravity(0, 0, -world.even_gravity, **client)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=time_step_s,
        numSubSteps=0,
        numSolverIterations=iterations,
        solverResidualThreshold=RESIDUAL,
        enableConeFriction=1,
        deterministicOverlappingPairs=1,
        enableFileCaching=0,
        **client,
    )
    surfaces = {}
    if world.planet is not None:
        ball, below = (world.planet,) * 3, (0.0, 0.0, -world.planet)
        surfaces[add_box(client, ball, below, mass=0.0, is_ball=True)] = 0
    elif world.ground:
        half = (_GROUND_REACH, _GROUND_REACH, 1.0)
        surfaces[add_box(client, half, (0.0, 0.0, -1.0), mass=0.0)] = 0
    for k, box in enumerate(world.terrain, 1):
        turn = pybullet.getQuaternionFromEuler((math.radians(box.slope_deg), 0.0, 0.0))
        if box.heading_deg:
            turn = quaternion_of(shape_of(box).rotation)[[1, 2, 3, 0]].tolist()
        half = (box.size[0] / 2, box.size[1] / 2, box.size[2] / 2)
        surfaces[add_box(client, half, box.center, mass=0.0, turn=turn)] = k
    cargo = world.cargo
    if cargo is None:
        return surfaces, None
    turn = quaternion_of(cargo.rotation)[[1, 2, 3, 0]].tolist()
    body = add_box(
        client, cargo.size / 2, cargo.position, mass=cargo.mass, turn=turn, is_ball=cargo.is_ball
    )
    return surfaces, body


def friction_of(structure: Structure, blocks: IntArray) -> float:
    """Return a cluster's friction: a link has one coefficient, its wheels' if it has any."""
    parts = [structure.parts[i] for i in blocks]
    deciding = next((part for part in parts if part.is_wheel), parts[0])
    return float(deciding.physics.friction)


def limit_spin(
    client: Mapping[str, int], components: Sequence[HingedComponent], motion: Motion
) -> None:
    """Slow down components that spin faster than the game's limit.

    Args:
        client: The engine's world.
    """
    for component in components:
        root = component.inside[0]
        spin = motion.spin[root]
        speed = float(np.linalg.norm(spin))
        if speed > MAX_SPIN:
            slower = (spin * (MAX_SPIN / speed)).tolist()
            velocity = motion.velocity[root].tolist()
            pybullet.resetBaseVelocity(component.body, velocity, slower, **client)


with quiet_output():
    import pybullet


def mixed_clusters(structure: Structure, clusters: Clusters) -> tuple[int, ...]:
    """Return the clusters without a wheel whose blocks differ in friction."""
    mixed = []
    for c, blocks in enumerate(clusters.blocks):
        parts = [structure.parts[i] for i in blocks]
        alike = len({part.physics.friction for part in parts}) == 1
        if not alike and not any(part.is_wheel for part in parts):
            mixed.append(c)
    return tuple(mixed)


def follow_friction(
    client: Mapping[str, int],
    structure: Structure,
    clusters: Mapping[int, tuple[int, int]],
    shapes: Sequence[ShapeTable],
    motion: Motion,
) -> None:
    """Set the friction of bodies to that of their blocks in contact, weighted by their loads.

    Args:
        client: The engine's world.
        clusters: Body and link of each cluster to follow.
        shapes: (C,) shapes of each cluster.
    """
    coefficients = np.array([part.physics.friction for part in structure.parts])
    for c, (body, link) in clusters.items():
        touching = [
            (contact[5] if (contact[1], contact[3]) == (body, link) else contact[6], contact[9])
            for contact in pybullet.getContactPoints(body, **client)
            if (body, link) in ((contact[1], contact[3]), (contact[2], contact[4]))
        ]
        if not touching:
            continue
        points = np.array([point for point, _ in touching])
        loads = np.array([max(load, 1e-6) for _, load in touching])
        local = (points - motion.position[c]) @ motion.rotation[c]
        row, block, weight = shapes[c].share(local)
        shares = weight * loads[row]
        friction = float(shares @ coefficients[block] / shares.sum())
        set_friction(client, body, link, friction)
