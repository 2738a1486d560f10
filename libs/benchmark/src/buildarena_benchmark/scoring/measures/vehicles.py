"""The wheels of a vehicle, and how long it keeps them all."""

from collections.abc import Iterable, Sequence

import numpy as np

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.masses import center_of
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series


def wheels_of(run: Run) -> list[int]:
    """Return the tracked blocks that are wheels, by their numbers; of a trial with forces."""
    wheels = set(run.bearing.wheel_ids)
    wheels |= {block.id for block in run.machine.blocks.values() if block.module.motor}
    return [k for k, block in enumerate(run.trajectory.block_ids) if block in wheels]


def paths_of(run: Run, wheels: Sequence[int]) -> list[Series]:
    """Return the paths of the centre of mass and of the middle of some wheels, (T, 3) each."""
    paths = [center_of(run)]
    if len(wheels):
        paths.append(run.positions[:, wheels].mean(axis=1))
    return paths


def in_order(ways: Iterable[Iterable[tuple[int, int]]]) -> list[int]:
    """Return the samples at which numbered places were passed by all of some paths, in order.

    Args:
        ways: Of each path the places that it passed, with the samples, in order of time. A place
            counts that comes after no later one.
    """
    passed: list[dict[int, int]] = []
    for way in ways:
        samples: dict[int, int] = {}
        for place, sample in way:
            if place > max(samples, default=-1):
                samples[place] = sample
        passed.append(samples)
    common = set.intersection(*(set(samples) for samples in passed))
    return sorted(max(samples[place] for samples in passed) for place in common)


def has_wheels(joined: Mask, wheels: Sequence[int]) -> Mask:
    """Return when every wheel is still joined to the starting block, (T,); never without wheels.

    Args:
        joined: (T, N) as `joined_to_start` returns.
        wheels: Indices of the blocks that are wheels.
    """
    complete = joined[:, wheels].all(axis=1) if len(wheels) else np.zeros(len(joined), dtype=bool)
    return np.asarray(np.logical_and.accumulate(complete))
