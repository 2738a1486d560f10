"""The forces that blocks exert by themselves: fans, nozzles, wings, balloons, brakes and others.

Each has a row: the block it acts on and the point of it where it acts. They are worked out from
the motion every `FORCES_EVERY_S`, and held until the next time, turning with their blocks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from buildarena_geometry.modules.forces import Altitude, Brake, Flywheel, Wing
from buildarena_simulation.constants import GRAVITY, JointKind
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    BoolArray,
    FloatArray,
    IntArray,
    Part,
    Structure,
)
from buildarena_simulation.structure.vectors import axis_frame

_NOT_ATTACHED: Final = [
    JOINT_KINDS.index(JointKind.BRACE),
    JOINT_KINDS.index(JointKind.FAR_JOINT),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wings:
    """Forces of the air on K blocks, in one frame; fields as in geometry's `Wing`.

    Attributes:
        normal: (K, 3) direction of the force, unit length.
        flow: (K, 3) direction of the flow that it reacts to, unit length.
        coefficient: (K,) force per speed to the power of `power` + 1, mass·unit/s².
        power: (K,) further exponent of the speed.
        cap_speed: (K,) speed above which the force stops growing with it, units/s.
        one_sided: (K,) true if air against the normal exerts no force.
    """

    normal: FloatArray
    flow: FloatArray
    coefficient: FloatArray
    power: FloatArray
    cap_speed: FloatArray
    one_sided: BoolArray

    def __len__(self) -> int:
        return len(self.coefficient)

    def forces(self, velocity: FloatArray, fixed: BoolArray) -> FloatArray:
        """Return the force of the air on each block, (K, 3), mass·unit/s².

        By its law, still air accelerates a blade along its pitch; in the game its drive compensates
        for that. A fixed blade has no drive, so its accelerating part is omitted and the air only
        takes energy.

        Args:
            velocity: (K, 3) of the blocks' centres, in the frame of the normals, units/s.
            fixed: (K,) true for blocks fixed to the root of their component.
        """
        along = (velocity * self.flow).sum(axis=1)
        speed = np.sqrt((velocity * velocity).sum(axis=1))
        size = -self.coefficient * along * np.minimum(speed, self.cap_speed) ** self.power
        size = np.where(self.one_sided & (along < 0.0), 0.0, size)
        forces = size[:, None] * self.normal
        power = np.where(fixed, np.maximum((forces * velocity).sum(axis=1), 0.0), 0.0)
        return np.asarray(forces - (power / np.maximum(speed, 1e-9) ** 2)[:, None] * velocity)


def wings_of(wings: Sequence[Wing], rotations: FloatArray) -> Wings:
    """Return the wings of blocks that are turned.

    Args:
        wings: (K,) wings of the blocks' modules.
        rotations: (K, 3, 3) of the blocks.
    """

    def turned_by(vectors: Sequence[Sequence[float]]) -> FloatArray:
        rows = np.array(vectors, dtype=np.float64).reshape(-1, 3)
        return np.asarray(np.einsum("kij,kj->ki", rotations, rows))

    return Wings(
        normal=turned_by([wing.normal for wing in wings]),
        flow=turned_by([wing.flow for wing in wings]),
        coefficient=np.array([wing.coefficient for wing in wings], dtype=np.float64),
        power=np.array([wing.power for wing in wings], dtype=np.float64),
        cap_speed=np.array([wing.cap_speed for wing in wings], dtype=np.float64),
        one_sided=np.array([wing.one_sided for wing in wings], dtype=bool),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnForces:
    """Sources of forces, R rows.

    W wings, P that push, L balloons, A that hold a height, B brakes, D decouplers and F flywheels
    are in this order; each decoupler has two rows, its own and its base's, and each flywheel has
    two, which are a couple.

    Attributes:
        block: (R,) block that each acts on.
        point: (R, 3) point of application, machine frame, units.
        direction: (R, 3) of a push in the machine frame, unit length; zero in the other rows.
        wings: Air forces.
        pushes: (P,) blocks that push.
        push: (P,) mass·unit/s².
        needs_air: (P,) true if the push decreases with the density of the air.
        steady_speed: (P,) see `Push`, units/s; infinite if it has none.
        lift: (L,) mass·unit/s².
        altitude_of: (A,) data of each block that holds a height.
        altitudes: (A,) blocks that hold a height.
        brake_of: (B,) data of each brake.
        brakes: (B,) blocks that air brakes while they are open.
        flywheel_of: (F,) data of each flywheel.
        flywheels: (F,) blocks with one.
        turn_axis: (F, 3) machine frame, unit length.
        decouplers: (D,) blocks that release.
        decoupled: (D,) member that each releases.
        impulse: (D,) mass·unit/s.
    """

    block: IntArray
    point: FloatArray
    direction: FloatArray
    wings: Wings
    pushes: IntArray
    push: FloatArray
    needs_air: BoolArray
    steady_speed: FloatArray
    lift: FloatArray
    altitude_of: tuple[Altitude, ...]
    altitudes: IntArray
    brake_of: tuple[Brake, ...]
    brakes: IntArray
    flywheel_of: tuple[Flywheel, ...]
    flywheels: IntArray
    turn_axis: FloatArray
    decouplers: IntArray
    decoupled: IntArray
    impulse: FloatArray

    def __len__(self) -> int:
        return len(self.block)


def own_forces_of(structure: Structure) -> OwnForces:
    """Return the forces that a structure's blocks exert by themselves."""
    parts = structure.parts
    forces = [part.module for part in parts]
    wings = [i for i, of in enumerate(forces) if of.wing]
    pushes = [i for i, of in enumerate(forces) if of.push]
    lifts = [i for i, of in enumerate(forces) if of.lift]
    altitudes = [i for i, of in enumerate(forces) if of.altitude]
    brakes = [i for i, of in enumerate(forces) if of.brake]
    flywheels = [i for i, of in enumerate(forces) if of.flywheel]
    attachments = attachments_of(structure)
    decouplers = [i for i, of in enumerate(forces) if of.decouple and i in attachments]
    joints = [attachments[i] for i in decouplers]
    alone = [*wings, *pushes, *lifts, *altitudes, *brakes]
    direction = np.zeros((len(alone) + 2 * len(decouplers) + 2 * len(flywheels), 3))
    for row, i in enumerate(pushes, len(wings)):
        direction[row] = _pushed(parts[i])
    for row, i in enumerate(decouplers, len(alone)):
        direction[row] = parts[i].rotation[:, 2]
        direction[row + len(decouplers)] = -parts[i].rotation[:, 2]
    couples = _couples([parts[i] for i in flywheels])
    direction[len(direction) - 2 * len(flywheels) :] = couples.direction
    places = [structure.members.point[k] for k in joints]
    bases: IntArray = structure.members.first[joints] if joints else _ids([])
    return OwnForces(
        block=np.array([*alone, *decouplers, *bases, *flywheels, *flywheels], dtype=np.int64),
        point=np.array(
            [*(parts[i].center for i in alone), *places, *places, *couples.point]
        ).reshape(-1, 3),
        direction=direction,
        wings=wings_of([of.wing for of in forces if of.wing], structure.rotations[_ids(wings)]),
        pushes=_ids(pushes),
        push=GRAVITY * np.array([of.push.force for of in forces if of.push]),
        needs_air=np.array([of.push.needs_air for of in forces if of.push], dtype=bool),
        steady_speed=np.array([of.push.steady_speed or np.inf for of in forces if of.push]),
        lift=GRAVITY * np.array([of.lift.force for of in forces if of.lift]),
        altitudes=_ids(altitudes),
        altitude_of=tuple(of.altitude for of in forces if of.altitude),
        brakes=_ids(brakes),
        brake_of=tuple(of.brake for of in forces if of.brake),
        flywheels=_ids(flywheels),
        flywheel_of=tuple(of.flywheel for of in forces if of.flywheel),
        turn_axis=couples.axis,
        decouplers=_ids(decouplers),
        decoupled=_ids(joints),
        impulse=np.array([_impulse(parts[i]) for i in decouplers]),
    )


def attachments_of(structure: Structure) -> dict[int, int]:
    """Return the member that joins each block to the face it sits on, if there is one."""
    members = structure.members
    return {
        int(members.second[k]): k
        for k in reversed(range(len(members)))
        if members.kind[k] not in _NOT_ATTACHED
    }


class _Couples(NamedTuple):
    """Axes (F, 3), points and directions (2F, 3) of forces that turn blocks by a unit torque."""

    axis: FloatArray
    point: FloatArray
    direction: FloatArray


def _couples(parts: list[Part]) -> _Couples:
    axis = np.array([_turned(part) for part in parts]).reshape(-1, 3)
    # The frames' other columns are across the axis, to which they are at right angles.
    across = np.array([axis_frame(own)[:, 1] for own in axis]).reshape(-1, 3)
    center = np.array([part.center for part in parts]).reshape(-1, 3)
    along = np.cross(axis, across)
    return _Couples(
        axis=axis,
        point=np.concatenate([center + across / 2, center - across / 2]),
        direction=np.concatenate([along, -along]),
    )


def _turned(part: Part) -> FloatArray:
    flywheel = part.module.flywheel
    return np.zeros(3) if flywheel is None else part.rotation @ np.array(flywheel.axis)


def _ids(blocks: list[int]) -> IntArray:
    return np.array(blocks, dtype=np.int64)


def _pushed(part: Part) -> FloatArray:
    push = part.module.push
    return np.zeros(3) if push is None else part.rotation @ np.array(push.direction)


def _impulse(part: Part) -> float:
    decoupling = part.module.decouple
    return decoupling.impulse if decoupling else 0.0
