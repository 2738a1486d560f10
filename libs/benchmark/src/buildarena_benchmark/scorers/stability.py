"""Tells a rollout that blew up from one that merely went badly."""

from typing import TYPE_CHECKING

import numpy as np

from buildarena_benchmark.scorers.series import speeds
from buildarena_simulation.constants import GRAVITY

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

_MARGIN = 1.5
_SLACK = 15.0
"""Speed any solver's correction may add for a moment, units/s."""


def is_unstable(machine: "Machine", trajectory: "Trajectory") -> bool:
    """Whether the trajectory holds what no thrust, fall or wheel can explain.

    Either something is not finite, or some block or the cargo is faster than it could have become:
    by falling from the greatest height of the trial so far, by the strongest thrust since its
    start, or by a wheel's rim at the machine's full size; with a margin.

    Args:
        machine: Gives cannons, wheels and size.
        trajectory: The trial.
    """
    positions = trajectory.positions.astype(np.float64)
    if trajectory.cargo_position is not None:
        cargo = trajectory.cargo_position.astype(np.float64)
        positions = np.concatenate([positions, cargo[:, None]], axis=1)
    if not (np.isfinite(positions).all() and np.isfinite(trajectory.quaternions).all()):
        return True
    if len(trajectory.time_s) < 2 or not positions.shape[1]:  # noqa: PLR2004 - no step, no speed
        return False
    return bool(
        (speeds(trajectory.time_s, positions) > _limits(machine, trajectory, positions)).any()
    )


def _limits(machine: "Machine", trajectory: "Trajectory", positions: np.ndarray) -> np.ndarray:
    """Greatest plausible speed in each step, (T - 1, 1), units/s."""
    top = np.maximum.accumulate(positions[:, :, 2].max(axis=1))[1:]
    fall = np.sqrt(2.0 * GRAVITY * np.maximum(top, 0.0))
    modules = {block.module.name: block.module for block in machine.blocks.values()}.values()
    # A cannon torn off flies fastest: it pushes nothing but itself.
    pushes = (module.thrust.heated / module.mass for module in modules if module.thrust)
    push = max(pushes, default=0.0) * GRAVITY
    spin = max((module.motor.speed for module in modules if module.motor), default=0.0)
    extent = positions[0].max(axis=0) - positions[0].min(axis=0)
    rim = spin * (float(np.linalg.norm(extent)) + 2.0)
    return np.asarray(_MARGIN * (fall + push * trajectory.time_s[1:] + rim) + _SLACK)[:, None]
