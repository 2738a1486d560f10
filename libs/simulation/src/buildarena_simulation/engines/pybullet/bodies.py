"""Bodies of a PyBullet world: boxes, damping and friction."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from buildarena_simulation.constants import FRICTION_TERRAIN, MAX_SPIN
from buildarena_simulation.engines.base import CargoPose
from buildarena_simulation.engines.pybullet.hinges import HingedComponent
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.structure.model import FloatArray, IntArray, Structure
from buildarena_simulation.structure.motion import Motion

with quiet_output():
    import pybullet

_SPEED_CAP: Final = 1e5


def add_box(
    client: Mapping[str, int],
    half: Sequence[float] | FloatArray,
    center: Sequence[float] | FloatArray,
    *,
    mass: float,
    turn: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
) -> int:
    """Adds a box of neutral friction; its id.

    Args:
        client: The engine's world.
        half: (3,) half-extents, units.
        center: (3,) world frame, units.
        mass: 0 for one that never moves.
        turn: World_from_box as a quaternion (x, y, z, w).
    """
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, **client)
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
    """Takes a body's damping and cap on speed away: drag is a force of ours."""
    pybullet.changeDynamics(
        body,
        -1,
        linearDamping=0,
        angularDamping=0,
        maxJointVelocity=_SPEED_CAP,
        **client,
    )


def set_friction(client: Mapping[str, int], body: int, link: int, friction: float) -> None:
    """Gives one link a coefficient of friction, and no bounce."""
    # A call of its own: one that also sets damping drops the friction of a link.
    pybullet.changeDynamics(
        body,
        link,
        lateralFriction=friction,
        rollingFriction=0,
        spinningFriction=0,
        restitution=0,
        **client,
    )


def pose_of(client: Mapping[str, int], body: int | None) -> CargoPose:
    """Where a body is and how fast its centre moves."""
    position, turn = pybullet.getBasePositionAndOrientation(body, **client)
    velocity, _ = pybullet.getBaseVelocity(body, **client)
    return CargoPose(
        position=np.array(position),
        quaternion=np.array(turn)[[3, 0, 1, 2]],
        velocity=np.array(velocity),
    )


def set_up(
    client: Mapping[str, int],
    *,
    gravity: float,
    time_step_s: float,
    iterations: int,
    residual: float,
) -> None:
    """Sets a new world's gravity and solver.

    Args:
        client: The engine's world.
        gravity: Downward acceleration, units/s².
        time_step_s: Length of a step, seconds.
        iterations: Most iterations of the solver.
        residual: At which it stops.
    """
    pybullet.setGravity(0, 0, -gravity, **client)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=time_step_s,
        numSubSteps=0,
        numSolverIterations=iterations,
        solverResidualThreshold=residual,
        enableConeFriction=1,
        deterministicOverlappingPairs=1,
        enableFileCaching=0,
        **client,
    )


def friction_of(structure: Structure, blocks: IntArray) -> float:
    """Friction of a cluster: a link has one coefficient, that of its wheels if it has any."""
    parts = [structure.parts[i] for i in blocks]
    deciding = next((part for part in parts if part.is_wheel), parts[0])
    return float(deciding.physics.friction)


def limit_spin(
    client: Mapping[str, int], components: Sequence[HingedComponent], motion: Motion
) -> None:
    """Slows components that spin faster than any part of the game may.

    Args:
        client: The engine's world.
        components: Its components.
        motion: The clusters' motion.
    """
    for component in components:
        root = component.inside[0]
        spin = motion.spin[root]
        speed = float(np.linalg.norm(spin))
        if speed > MAX_SPIN:
            slower = (spin * (MAX_SPIN / speed)).tolist()
            velocity = motion.velocity[root].tolist()
            pybullet.resetBaseVelocity(component.body, velocity, slower, **client)
