"""Poses of machine and cargo at the start of a trial, and their perturbation by a seed."""

import hashlib
import math
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from buildarena_simulation.constants import CARGO_SHIFT, START_DROP, START_SHIFT, START_YAW_DEG
from buildarena_simulation.engines.base import CargoBox
from buildarena_simulation.scenario import (
    GroundPlacement,
    Placement,
    ReleasedPlacement,
    Scenario,
    SpanPlacement,
)
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion, at_rest
from buildarena_simulation.structure.vectors import turn_about

_CLEARANCE = 0.005
"""Height of the lowest point above the ground at the start, units: touching, not overlapping."""

_QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """The start of a trial.

    Attributes:
        position: (3,) of the machine frame, world frame, units.
        rotation: (3, 3) world_from_machine.
        velocity: (3,) of every block, world frame, units/s.
    """

    position: FloatArray
    rotation: FloatArray
    cargo: CargoBox | None
    velocity: FloatArray = field(default_factory=lambda: np.zeros(3))


def motion_at(start: Start, clusters: Clusters) -> Motion:
    """Return the motion of a machine's clusters at the start of a trial."""
    motion = at_rest(clusters, start.position, start.rotation)
    return replace(motion, velocity=motion.velocity + start.velocity)


def start_of(structure: Structure, scenario: Scenario, seed: int | None = None) -> Start:
    """Return the start of a trial: the exact one, or a perturbed one.

    Args:
        seed: Seed of the machine's position and yaw and of the cargo's position within the
            tolerances of `constants`; None for the exact ones.
    """
    position, rotation = place(structure, scenario.placement)
    shift, yaw, cargo_shift = np.zeros(3), 0.0, np.zeros(3)
    if seed is not None:
        draw = np.random.default_rng(seed).uniform(-1.0, 1.0, size=6)
        shift = np.array([*(START_SHIFT * draw[:2]), START_DROP * (1.0 + draw[2]) / 2])
        yaw = math.radians(START_YAW_DEG * draw[3])
        cargo_shift[:2] = CARGO_SHIFT * draw[4:]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    position, rotation = turn @ position + shift, turn @ rotation
    return Start(
        position=position,
        rotation=rotation,
        cargo=_cargo_at_start(structure, scenario, position, cargo_shift),
        velocity=_velocity_of(scenario.placement),
    )


def start_digest(start: Start) -> str:
    """Return a short digest of a start's figures, for the settings of a trajectory."""
    arrays = [start.position, start.rotation]
    if start.cargo is not None:
        arrays += [start.cargo.size, start.cargo.position]
        if not np.array_equal(start.cargo.rotation, np.eye(3)):
            arrays.append(start.cargo.rotation)
    if start.velocity.any():
        arrays.append(start.velocity)
    values = np.concatenate([np.asarray(array, np.float64).ravel() for array in arrays])
    return hashlib.sha256(values.tobytes()).hexdigest()[:16]


def _velocity_of(placement: Placement) -> FloatArray:
    return np.array(placement.velocity if isinstance(placement, ReleasedPlacement) else [0.0] * 3)


def _turn_of(placement: Placement) -> FloatArray | None:
    """Return the rotation of a machine at the start relative to how it was built; None if none."""
    if not isinstance(placement, GroundPlacement):
        return None
    angles = {(0.0, 0.0, 1.0): placement.heading_deg, (1.0, 0.0, 0.0): placement.tilt_deg}
    turns = [turn_about(np.array(axis), -math.radians(deg)) for axis, deg in angles.items() if deg]
    return reduce(lambda turn, other: other @ turn, turns) if turns else None


def place(structure: Structure, placement: Placement) -> tuple[FloatArray, FloatArray]:
    """Return the pose world_from_machine at the start.

    Returns:
        The position (3,), units, and the rotation (3, 3).
    """
    turn = _turn_of(placement)
    bounds = structure.bounds(turn)
    if not isinstance(placement, SpanPlacement):
        start = next(
            (part.shown for part in structure.parts if part.module.kind == "start"),
            structure.shown[0],
        )
        rotation = np.eye(3) if turn is None else turn
        start = rotation @ start
        height = placement.height if isinstance(placement, ReleasedPlacement) else _CLEARANCE
        return np.array([-start[0], -start[1], height - bounds[0, 2]]), rotation
    extent = bounds[1] - bounds[0]
    turned = extent[1] <= placement.gap < extent[0]
    rotation = _QUARTER_TURN if turned else np.eye(3)
    middle = rotation @ bounds.mean(axis=0)
    lowest = structure.shown[:, 2].min()
    return np.array([-middle[0], -middle[1], placement.lowest_center - lowest]), rotation


def _cargo_at_start(
    structure: Structure, scenario: Scenario, position: FloatArray, shift: FloatArray
) -> CargoBox | None:
    """Return the cargo at its position, or over (0, 0) above the machine's top; None without.

    Args:
        position: (3,) world_from_machine at the start, units.
        shift: (3,) perturbation of the cargo, units.
    """
    cargo = scenario.cargo
    if cargo is None:
        return None
    if cargo.at is not None:
        middle = np.array(cargo.at) + np.array([0.0, 0.0, cargo.size[2] / 2 + _CLEARANCE])
    else:
        top = float(structure.bounds(_turn_of(scenario.placement))[1, 2] + position[2])
        middle = np.array([0.0, 0.0, top + cargo.drop_height + cargo.size[2] / 2])
    return CargoBox(
        size=np.array(cargo.size),
        position=middle + shift,
        mass=cargo.mass_at(0.0),
        rotation=turn_about(np.array([0.0, 0.0, 1.0]), -math.radians(cargo.heading_deg)),
        is_ball=cargo.shape == "ball",
    )
