"""The forces that blocks exert by themselves: fans, wings, balloons and what pushes off.

Each has a row: the block it acts on and the point of it where it acts. They are worked out from
the motion every `FORCES_EVERY_S`, and held until the next time, turning with their blocks.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_geometry.modules.forces import Altitude
from buildarena_simulation.constants import GRAVITY, JointKind
from buildarena_simulation.structure.aerodynamics import Wings, wings_of
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    FloatArray,
    IntArray,
    Part,
    Structure,
)

_NO_SEATS: Final = [JOINT_KINDS.index(JointKind.BRACE), JOINT_KINDS.index(JointKind.FAR_JOINT)]


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnForces:
    """Who exerts what; R rows: W wings, P fans, L balloons, A that hold a height, D that let go.

    The rows are in this order; each block that lets go has two, its own and its base's.

    Attributes:
        block: (R,) the block each acts on.
        point: (R, 3) where, machine frame, units.
        direction: (R, 3) of a push in the machine frame, unit length; zero in the other rows.
        wings: What air does.
        pushes: (P,) blocks with a fan.
        push: (P,) mass·unit/s².
        lift: (L,) mass·unit/s².
        altitude_of: (A,) what holds each height.
        altitudes: (A,) blocks that hold a height.
        decouplers: (D,) blocks that let go.
        seats: (D,) the member that each lets go.
        impulse: (D,) mass·unit/s.
    """

    block: IntArray
    point: FloatArray
    direction: FloatArray
    wings: Wings
    pushes: IntArray
    push: FloatArray
    lift: FloatArray
    altitude_of: tuple[Altitude, ...]
    altitudes: IntArray
    decouplers: IntArray
    seats: IntArray
    impulse: FloatArray

    def __len__(self) -> int:
        return len(self.block)


def own_forces_of(structure: Structure) -> OwnForces:
    """The forces that a structure's blocks exert by themselves."""
    parts = structure.parts
    forces = [part.module for part in parts]
    wings = [i for i, of in enumerate(forces) if of.wing]
    pushes = [i for i, of in enumerate(forces) if of.push]
    lifts = [i for i, of in enumerate(forces) if of.lift]
    altitudes = [i for i, of in enumerate(forces) if of.altitude]
    seats = seats_of(structure)
    decouplers = [i for i, of in enumerate(forces) if of.decouple and i in seats]
    joints = [seats[i] for i in decouplers]
    alone = [*wings, *pushes, *lifts, *altitudes]
    direction = np.zeros((len(alone) + 2 * len(decouplers), 3))
    for row, i in enumerate(pushes, len(wings)):
        direction[row] = _pushed(parts[i])
    for row, i in enumerate(decouplers, len(alone)):
        direction[row] = parts[i].rotation[:, 2]
        direction[row + len(decouplers)] = -parts[i].rotation[:, 2]
    places = [structure.members.point[k] for k in joints]
    bases: IntArray = structure.members.first[joints] if joints else _ids([])
    return OwnForces(
        block=np.array([*alone, *decouplers, *bases], dtype=np.int64),
        point=np.array([*(parts[i].center for i in alone), *places, *places]).reshape(-1, 3),
        direction=direction,
        wings=wings_of([of.wing for of in forces if of.wing], structure.rotations[_ids(wings)]),
        pushes=_ids(pushes),
        push=GRAVITY * np.array([of.push.force for of in forces if of.push]),
        lift=GRAVITY * np.array([of.lift.force for of in forces if of.lift]),
        altitudes=_ids(altitudes),
        altitude_of=tuple(of.altitude for of in forces if of.altitude),
        decouplers=_ids(decouplers),
        seats=_ids(joints),
        impulse=np.array([_impulse(parts[i]) for i in decouplers]),
    )


def seats_of(structure: Structure) -> dict[int, int]:
    """The member that joins each block to the face it sits on, where there is one."""
    members = structure.members
    return {
        int(members.second[k]): k
        for k in reversed(range(len(members)))
        if members.kind[k] not in _NO_SEATS
    }


def _ids(blocks: list[int]) -> IntArray:
    return np.array(blocks, dtype=np.int64)


def _pushed(part: Part) -> FloatArray:
    push = part.module.push
    return np.zeros(3) if push is None else part.rotation @ np.array(push.direction)


def _impulse(part: Part) -> float:
    decoupling = part.module.decouple
    return decoupling.impulse if decoupling else 0.0
