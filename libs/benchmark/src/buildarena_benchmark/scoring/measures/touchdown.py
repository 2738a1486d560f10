"""First contact of a machine in the air, and its speed then."""

from typing import Final

import numpy as np

from buildarena_benchmark.scoring.measures.carrying import from_below
from buildarena_benchmark.scoring.measures.masses import joined_masses
from buildarena_benchmark.scoring.measures.run import Run

_TOUCH: Final = 0.02
"""Smallest share of the machine's weight on the ground that counts as a touch."""

_LAST_SAMPLES: Final = 3
"""Number of samples before the touch over which the greatest speed is the speed at landing."""


def first_touch(run: Run) -> int | None:
    """Return the sample at which ground or terrain first supports the machine, or None.

    Args:
        run: Has forces.
    """
    touching = from_below(run) > _TOUCH * joined_masses(run)
    return int(touching.argmax()) if touching.any() else None


def speeds_before(run: Run, sample: int) -> tuple[float, float]:
    """Return the speeds of the machine's mass downwards and aside before a sample, units/s."""
    # The step into the sample that touches may be braked by the ground already.
    end = max(sample, 2)
    rows = slice(max(end - _LAST_SAMPLES - 1, 0), end)
    masses = run.block_masses
    weights = masses * run.joined[sample]
    path = np.einsum("tnk,n->tk", run.positions[rows], weights)
    steps = np.diff(run.time_s[rows])
    speeds = np.diff(path / max(float(weights.sum()), 1e-9), axis=0) / steps[:, None]
    aside = np.linalg.norm(speeds[:, :2], axis=1)
    return float((-speeds[:, 2]).max(initial=0.0)), float(aside.max(initial=0.0))
