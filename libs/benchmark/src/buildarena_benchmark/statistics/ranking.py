"""Rank aggregation over tasks: who builds best, and who is statistically tied.

On each task a model gets two ranks, one by success rate and one by indicator (ties share the
mean of their places); its mean rank is the mean of all of them. This is Borda's count, and uses
no figure but those the paper names: "success rate and indicator via rank aggregation across
tasks".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.statistics.proportions import LEVEL

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """Models ordered over tasks; arrays have one entry for each model.

    Attributes:
        mean_rank: (M,) float64, 1 is the best possible.
        rank: (M,) int64: 1 + the number of models that are better beyond chance. Models that
            is statistically tied with the same betters share a rank.
        low: (M,) int64, lower end of the bootstrap interval of the place.
        high: (M,) int64, upper end of it.
        better: (M, M) bool: row is better than column beyond chance.
    """

    mean_rank: Floats
    rank: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    better: NDArray[np.bool_]


def descending_ranks(values: Floats) -> Floats:
    """Ranks along the last axis, the greatest value first; ties share their mean place.

    Args:
        values: (…, M) float64.

    Returns:
        (…, M) float64, from 1.
    """
    others, own = values[..., None, :], values[..., :, None]
    greater = (others > own).sum(axis=-1)
    equal = (others == own).sum(axis=-1)
    ranks: Floats = greater + (equal + 1) / 2
    return ranks


def mean_ranks(success_rate: Floats, indicator: Floats) -> Floats:
    """Each model's mean rank over tasks and both figures.

    Args:
        success_rate: (…, T, M) float64: M models on T tasks.
        indicator: (…, T, M) float64.

    Returns:
        (…, M) float64.
    """
    both = descending_ranks(success_rate) + descending_ranks(indicator)
    mean: Floats = both.mean(axis=-2) / 2
    return mean


def rank_models(
    figures: tuple[Floats, Floats],
    replicates: tuple[Floats, Floats],
    trials: NDArray[np.int64],
    *,
    level: float = LEVEL,
) -> Ranking:
    """Ranks models, with the uncertainty that their resampled figures show.

    A model is better than another beyond chance when its mean rank is smaller in nearly all
    replicates: in more than the share that a one-sided test at half the level's error asks for.
    A resample of very few trials shows no spread, so there must also be enough trials for an
    exact permutation test to find a difference at all (four of each on a single task).

    Args:
        figures: Success rates and indicators, each (T, M) float64.
        replicates: The same of resampled trials, each (B, T, M) float64.
        trials: (T, M) int64, how many trials each figure rests on.
        level: Confidence level.

    Returns:
        The ranking; models in the order given.
    """
    means = mean_ranks(*replicates)
    wins = np.stack([(row[None, :] < means.T).mean(axis=1) for row in means.T])
    better = (wins >= (1 + level) / 2) & (smallest_p_value(trials) <= 1 - level)
    places = 1 + (means[:, None, :] < means[:, :, None]).sum(axis=-1)
    tail = (1 - level) / 2
    low = np.quantile(places, tail, axis=0, method="lower")
    high = np.quantile(places, 1 - tail, axis=0, method="higher")
    # A statistically tied model rules out no place.
    return Ranking(
        mean_rank=mean_ranks(*figures),
        rank=(1 + better.sum(axis=0)).astype(np.int64),
        low=np.minimum(low, 1 + better.sum(axis=0)).astype(np.int64),
        high=np.maximum(high, len(better) - better.sum(axis=1)).astype(np.int64),
        better=better,
    )


def smallest_p_value(trials: NDArray[np.int64]) -> Floats:
    """The least two-sided p-value that a permutation test of two models can reach.

    The labels of n and m trials can be dealt in C(n + m, n) ways on each task, and the most
    extreme deal is one of them.

    Args:
        trials: (T, M) int64.

    Returns:
        (M, M) float64, at most 1.
    """
    models = range(trials.shape[1])
    ways = np.array(
        [
            [sum(_log_binomial(int(n), int(m)) for n, m in trials[:, [i, j]]) for j in models]
            for i in models
        ]
    )
    least: Floats = np.minimum(1.0, 2.0 * np.exp(-ways))
    return least


def _log_binomial(first: int, second: int) -> float:
    return math.lgamma(first + second + 1) - math.lgamma(first + 1) - math.lgamma(second + 1)
