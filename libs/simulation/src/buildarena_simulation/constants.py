"""Constants of the world and the model, with where each comes from.

What belongs to a type of module (thrust, flame, motor, friction, drag) is in the module file.

Lengths are in units (the edge of a small block), masses in mass units, times in seconds. Forces
of joints are in mass·g (the weight of one mass unit is 1), moments in mass·g·unit, so that they do
not depend on the value of g. `docs/physics.md` explains the calibration.
"""

from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

GRAVITY: Final = 32.81
"""Downward acceleration, units/s². Source: public modding notes; other figures agree within 7 %."""

SAMPLE_RATE_HZ: Final = 25
"""Rate at which poses are recorded. Source: the paper, "Simulation Details"."""

AFTER_S: Final = 1.0
"""Time for which a trial continues after it is decided, seconds, so that its picture shows why."""

COLLISION_MARGIN: Final = 0.02
"""Reduction of a collision box's half-extents from the block's, units.

Fitted: full-size decks wedge between terrain walls with thousands of newtons.
"""

MAX_SPIN: Final = 30.0
"""Fastest spin of a free component, rad/s; wheels on their axles may spin faster.

Ours: game engines bound spin likewise; it keeps the explicit gyroscopic terms of a tumbling rocket
from gaining energy.
"""

FRICTION_TERRAIN: Final = 1.0
"""Neutral, so that a contact with terrain or cargo takes the other body's coefficient."""

FORCES_EVERY_S: Final = 0.008
"""Time between two evaluations of wings, fans and balloons, s.

Ours: air slows a block at a rate of at most coefficient · cap² / mass, 45/s for a propeller,
whatever it is fixed to; an explicit step is stable below 2/45 s.
"""

LOAD_FILTER_S: Final = 0.16
"""Time constant of the low-pass filter on block wrenches, s. Fitted at g = 32.81."""

CARGO_BOUNCE: Final = 0.78
"""Share of its speed beyond `MIN_LANDING_SPEED` with which a cargo leaves a machine without mass.

Fitted with `BOUNCE_MASS` to logs of the game: the first bounces on a beam of seven blocks, of mass
2.05, and on a bridge of 73, of some 22 (docs/physics.md).
"""

BOUNCE_MASS: Final = 12.4
"""Mass of a machine on which a cargo bounces half as well, mass units."""

MIN_LANDING_SPEED: Final = 2.0
"""Speed below which a cargo comes to rest on a machine, units/s.

Source: the default bounce threshold of the game's engine.
"""

BLOW_FILTER_S: Final = 0.05
"""Replacement for `LOAD_FILTER_S` while a cargo lands, s.

Fitted: the beam of seven survives the first landing and breaks at the second, as in the game log.
"""

MAX_PARTS: Final = 2000
"""Maximum number of blocks and connectors of a machine."""


class JointKind(StrEnum):
    """Connection of two blocks; each kind has its own strength.

    A module's attachment is one of them: an attachment, a mount, or a joint it moves on.
    """

    ATTACHMENT = "attachment"
    FAR_JOINT = "far_joint"
    MOUNT = "mount"
    AXLE = "axle"
    BRACE = "brace"
    HINGE = "hinge"
    SLIDER = "slider"
    BALL = "ball"
    CONSTANT_VELOCITY = "constant_velocity"


@dataclass(frozen=True, slots=True, kw_only=True)
class Strength:
    """The wrench at which a joint breaks.

    Attributes:
        force: Norm of the force in the joint, mass·g.
        moment: Norm of the moment in the joint, mass·g·unit.
        origin: Public source that states it, or the data that it was fitted to.
    """

    force: float
    moment: float
    origin: str


JOINT_STRENGTH: Final = MappingProxyType(
    {
        JointKind.ATTACHMENT: Strength(
            force=600.0,
            moment=200.0,
            origin="fitted to the one-shot bridge (1000) and the load ordering",
        ),
        JointKind.FAR_JOINT: Strength(
            force=1067.0,
            moment=355.0,
            origin="force: 35,000 force units, public modding notes; moment: in proportion",
        ),
        JointKind.MOUNT: Strength(
            force=1e5, moment=1e5, origin="public modding notes: practically never breaks"
        ),
        JointKind.AXLE: Strength(force=600.0, moment=200.0, origin="fitted, as an attachment"),
        JointKind.BRACE: Strength(force=600.0, moment=200.0, origin="fitted, as an attachment"),
        JointKind.HINGE: Strength(
            force=600.0, moment=200.0, origin="chosen: as an axle; the game's value is not public"
        ),
        JointKind.SLIDER: Strength(
            force=600.0, moment=200.0, origin="chosen: as an axle; the game's value is not public"
        ),
        JointKind.BALL: Strength(
            force=600.0, moment=200.0, origin="chosen: as an axle; it bears no moment but at a stop"
        ),
        JointKind.CONSTANT_VELOCITY: Strength(
            force=600.0, moment=200.0, origin="chosen: as an axle; the moment is the shaft's torque"
        ),
    }
)
JOINT_STIFFNESS: Final = (1.0, 0.32, 0.32, 0.054, 0.083, 0.083)
"""Axial, two shears, torsion, two bendings of a unit cube's joint; only ratios matter to loads.

Source: Euler-Bernoulli beam of square section, condensed to its midpoint, with a shear correction.
"""

BRACE_STIFFNESS: Final = 0.5
"""Axial stiffness of a brace of unit length, in the measure of `JOINT_STIFFNESS`."""

ROPE_STRENGTH: Final = 1000.0
"""Tension at which a winch's rope breaks, mass·g. Fitted: not public."""

MAX_WORLDS: Final = 16
"""Maximum number of perturbed trials of a machine: each takes as long as a trial. Ours."""

START_SHIFT: Final = 0.1
"""Maximum shift of the machine's start by a seed, along east and along north, units. Ours."""

START_DROP: Final = 0.05
"""Maximum lift of the machine's start by a seed, units. Ours."""

START_YAW_DEG: Final = 2.0
"""Maximum yaw of the machine's start by a seed, degrees. Ours."""

CARGO_SHIFT: Final = 0.1
"""Maximum shift of the cargo's start by a seed, along east and along north, units. Ours."""

KEY_DELAY_S: Final = 0.04
"""Maximum delay of each press and release of a key by a seed, seconds. Ours."""

DEFAULT_ENGINE: Final = "pybullet"
"""Default engine of every interface.

If it is not installed, a trial is refused: another engine would give another score.
"""
