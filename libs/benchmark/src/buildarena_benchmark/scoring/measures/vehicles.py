"""The wheels of a vehicle, and how long it keeps them all."""

from collections.abc import Sequence

import numpy as np

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.run import Run


def wheels_of(run: Run) -> list[int]:
    """Return the tracked blocks that are wheels, by their numbers; of a trial with forces."""
    wheels = set(run.bearing.wheel_ids)
    wheels |= {block.id for block in run.machine.blocks.values() if block.module.motor}
    return [k for k, block in enumerate(run.trajectory.block_ids) if block in wheels]


def has_wheels(joined: Mask, wheels: Sequence[int]) -> Mask:
    """Return when every wheel is still joined to the starting block, (T,); never without wheels.

    Args:
        joined: (T, N) as `joined_to_start` returns.
        wheels: Indices of the blocks that are wheels.
    """
    complete = joined[:, wheels].all(axis=1) if len(wheels) else np.zeros(len(joined), dtype=bool)
    return np.asarray(np.logical_and.accumulate(complete))
