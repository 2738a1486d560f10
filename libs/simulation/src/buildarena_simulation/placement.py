"""Where machine and cargo are at the start of a trial."""

import numpy as np

from buildarena_simulation.engines.base import CargoBox
from buildarena_simulation.scenario import Cargo, GroundPlacement, SpanPlacement
from buildarena_simulation.structure.model import FloatArray, Structure

_CLEARANCE = 0.005
"""Height of the lowest point above the ground at the start, units: touching, not overlapping."""

_NUDGE = 0.01

_QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def place(
    structure: Structure, placement: GroundPlacement | SpanPlacement
) -> tuple[FloatArray, FloatArray]:
    """The pose world_from_machine at the start.

    Args:
        structure: The machine.
        placement: How it is put.

    Returns:
        The position (3,), units, and the rotation (3, 3).
    """
    bounds = structure.bounds()
    if isinstance(placement, GroundPlacement):
        start = next(
            (part.shown for part in structure.parts if part.module.kind == "start"),
            structure.shown[0],
        )
        return np.array([-start[0], -start[1], _CLEARANCE - bounds[0, 2]]), np.eye(3)
    extent = bounds[1] - bounds[0]
    turned = extent[1] <= placement.gap < extent[0]
    rotation = _QUARTER_TURN if turned else np.eye(3)
    middle = rotation @ bounds.mean(axis=0)
    lowest = structure.shown[:, 2].min()
    return np.array([-middle[0], -middle[1], placement.lowest_center - lowest]), rotation


def jittered(position: FloatArray, seed: int) -> FloatArray:
    """The position moved sideways by up to a hundredth of a unit, at random.

    A result that such a jitter changes depends on luck.

    Args:
        position: (3,) units.
        seed: Of the random generator.
    """
    shift = np.random.default_rng(seed).uniform(-_NUDGE, _NUDGE, size=2)
    return np.asarray(position + np.array([*shift, 0.0]))


def cargo_at_start(
    structure: Structure, cargo: Cargo | None, position: FloatArray, rotation: FloatArray
) -> CargoBox | None:
    """The cargo above the machine's top, over (0, 0); None without cargo.

    Args:
        structure: The machine.
        cargo: The scenario's cargo.
        position: (3,) world_from_machine at the start, units.
        rotation: (3, 3) world_from_machine at the start; turns about the vertical only.
    """
    if cargo is None:
        return None
    top = float((structure.bounds()[1] @ rotation.T + position)[2])
    height = top + cargo.drop_height + cargo.size[2] / 2
    return CargoBox(
        size=np.array(cargo.size),
        position=np.array([0.0, 0.0, height]),
        mass=cargo.mass_at(0.0),
    )
