"""Bootstrap: means of resampled trials, and the intervals they give."""

from __future__ import annotations

from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.statistics.proportions import LEVEL

REPLICATES: Final = 1000
"""Resamples of each cell: enough for the 2.5 % quantiles to be steady to a few per cent."""

Floats = NDArray[np.float64]


def resampled_means(values: Floats, *, seed: int, replicates: int = REPLICATES) -> Floats:
    """Means of resamples of trials, drawn with replacement.

    The trials are sorted first, so their order does not matter: equal data give equal resamples.

    Args:
        values: (N, C) float64: N trials of C figures, which stay together.
        seed: Seed of the draws.
        replicates: How many resamples.

    Returns:
        (replicates, C) float64.
    """
    ordered = values[np.lexsort(values.T)]
    trials = len(ordered)
    draws = np.random.default_rng(seed).integers(
        0, trials, size=(replicates, trials), dtype=np.uint32
    )
    return np.stack([ordered[:, c][draws].mean(axis=1) for c in range(ordered.shape[1])], axis=1)


def mean_interval(
    values: Floats, means: Floats | None = None, *, seed: int = 0, level: float = LEVEL
) -> tuple[float, float] | None:
    """The bias-corrected and accelerated bootstrap interval of a mean.

    Args:
        values: (N,) float64.
        means: (B,) float64, means of resamples if there are some already.
        seed: Seed of the resamples otherwise.
        level: Confidence level.

    Returns:
        Lower and upper end; None for fewer than two trials. Values that are all equal give an
        interval without width.

    Source:
        B. Efron, J. Am. Stat. Assoc. 82 (1987) 171; acceleration of a mean: equation 7.3.
    """
    if len(values) < 2:  # noqa: PLR2004 - one value says nothing about spread
        return None
    # Sums depend on the order in their last digits; sorted, equal data give equal intervals.
    values = np.sort(values)
    mean = float(values.mean())
    away = values - mean
    if not np.any(away) or np.ptp(values) == 0.0:
        return mean, mean
    if means is None:
        means = resampled_means(values[:, None], seed=seed)[:, 0]
    normal = NormalDist()
    # Half of the ties count as below; the share is kept inside (0, 1), where the quantile is.
    tolerance = 1e-12 * float(np.abs(values).max())
    below = np.mean(means < mean - tolerance) + np.mean(np.abs(means - mean) <= tolerance) / 2
    bias = normal.inv_cdf(float(np.clip(below, 0.5 / len(means), 1 - 0.5 / len(means))))
    acceleration = float(np.sum(away**3) / (6 * np.sum(away**2) ** 1.5))

    def corrected(share: float) -> float:
        shift = bias + normal.inv_cdf(share)
        return normal.cdf(bias + shift / (1 - acceleration * shift))

    ends = np.quantile(means, [corrected((1 - level) / 2), corrected((1 + level) / 2)])
    return float(ends[0]), float(ends[1])
