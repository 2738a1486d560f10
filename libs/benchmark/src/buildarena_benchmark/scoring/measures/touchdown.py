"""First contact of a machine in the air, and its speed then."""

from typing import Final

import numpy as np

from buildarena_benchmark.scoring.measures.carrying import from_below
from buildarena_benchmark.scoring.measures.components import Mask, masses_of
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

_TOUCH: Final = 0.02
"""Smallest share of the machine's weight on the ground that counts as a touch."""

_LAST_SAMPLES: Final = 3
"""Number of samples before the touch over which the greatest speed is the speed at landing."""


def first_touch(machine: "Machine", trajectory: "Trajectory", joined: Mask) -> int | None:
    """Return the sample at which ground or terrain first supports the machine, or None.

    Args:
        trajectory: A trial with forces.
        joined: (T, N) as `joined_to_start` returns.
    """
    touching = from_below(trajectory) > _TOUCH * masses_of(machine, trajectory, joined)
    return int(touching.argmax()) if touching.any() else None


def speeds_before(
    machine: "Machine", trajectory: "Trajectory", joined: Mask, sample: int
) -> tuple[float, float]:
    """Return the speeds of the machine's mass downwards and aside before a sample, units/s.

    Args:
        joined: (T, N) as `joined_to_start` returns.
    """
    # The step into the sample that touches may be braked by the ground already.
    end = max(sample, 2)
    rows = slice(max(end - _LAST_SAMPLES - 1, 0), end)
    masses = np.array([machine.blocks[block].module.mass for block in trajectory.block_ids])
    weights = masses * joined[sample]
    path = np.einsum("tnk,n->tk", trajectory.positions[rows].astype(np.float64), weights)
    steps = np.diff(trajectory.time_s[rows])
    speeds = np.diff(path / max(float(weights.sum()), 1e-9), axis=0) / steps[:, None]
    aside = np.linalg.norm(speeds[:, :2], axis=1)
    return float((-speeds[:, 2]).max(initial=0.0)), float(aside.max(initial=0.0))
