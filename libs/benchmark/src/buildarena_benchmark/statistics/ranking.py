"""Rank aggregation over tasks: the best builder, and statistical ties.

On each task a model gets two ranks, one by success rate and one by indicator (ties share the
mean of their places); its mean rank is the mean of all of them. This is Borda's count, and uses
no figure but those the paper names: "success rate and indicator via rank aggregation across
tasks".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.statistics.permutation import PairTests
from buildarena_benchmark.statistics.proportions import LEVEL

Floats = NDArray[np.float64]

MAX_EVIDENCE: Final = 4.0
"""Evidence of one task counts in the ranking over tasks up to so many standard deviations: as in
ranks, being far ahead on one task does not outweigh being behind on many."""
ROUNDING: Final = 1e-9
"""Mean ranks that differ by less are equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """Models ordered over tasks; arrays have one entry for each model.

    Attributes:
        mean_rank: (M,) float64, 1 is the best possible.
        rank: (M,) int64: 1 + the number of models that are better beyond chance. Models that
            are statistically tied with the same betters share a rank.
        high: (M,) int64, upper end of the interval of the place, whose lower end is the rank. All
            intervals hold together at the level of their tests.
        better: (M, M) bool: row is better than column beyond chance.
    """

    mean_rank: Floats
    rank: NDArray[np.int64]
    high: NDArray[np.int64]
    better: NDArray[np.bool_]


def descending_ranks(values: Floats) -> Floats:
    """Rank along the last axis, the greatest value first; ties share their mean place.

    Args:
        values: (…, M) float64.

    Returns:
        (…, M) float64, from 1.
    """
    rivals, own = values[..., None, :], values[..., :, None]
    greater = (rivals > own).sum(axis=-1)
    equal = (rivals == own).sum(axis=-1)
    ranks: Floats = greater + (equal + 1) / 2
    return ranks


def mean_ranks(success_rate: Floats, indicator: Floats) -> Floats:
    """Return each model's mean rank over tasks and both figures.

    Args:
        success_rate: (…, T, M) float64: M models on T tasks.
        indicator: (…, T, M) float64.

    Returns:
        (…, M) float64.
    """
    both = descending_ranks(success_rate) + descending_ranks(indicator)
    mean: Floats = both.mean(axis=-2) / 2
    return mean


def fitted_ranks(success_rate: Floats, indicator: Floats) -> Floats:
    """Return each model's mean rank where some models lack some tasks, by least squares.

    A rank is the sum of a model's part and a task's part, so that a model is not worse for having
    met only strong ones. The ranks of a task that few models did are stretched to the range of all.
    Equal to `mean_ranks` where nothing is missing.

    Args:
        success_rate: (T, M) float64: M models on T tasks; NaN where a model lacks a task.
        indicator: (T, M) float64, with the same gaps. Shared tasks connect all models.

    Returns:
        (M,) float64.
    """
    present = ~np.isnan(success_rate)
    met = present.sum(axis=1, keepdims=True)
    both = (descending_ranks(success_rate) + descending_ranks(indicator)) / 2
    wide = 1 + (both - 1) * (present.shape[1] - 1) / np.maximum(met - 1, 1)
    ranks, mask = np.where(present, wide, 0.0), present.astype(np.float64)
    equations = np.diag(mask.sum(axis=0)) - mask.T @ (mask / met)
    values = ranks.sum(axis=0) - mask.T @ (ranks.sum(axis=1) / met[:, 0])
    model = np.linalg.lstsq(equations, values)[0]
    task = (ranks.sum(axis=1) - mask @ model) / met[:, 0]
    # Rounding must not decide the order.
    return np.asarray(np.round(model + task.mean(), 9), dtype=np.float64)


def combined(tests: Sequence[PairTests]) -> PairTests:
    """Combine evidence of the same pairs on several tasks with equal weights.

    Args:
        tests: Tests of each task, with the pairs in the same order; at least one.

    Source:
        S. A. Stouffer et al., The American Soldier 1 (1949), footnote 14.
    """
    from scipy.special import ndtr

    if len(tests) == 1:
        return tests[0]
    z = np.clip([test.z for test in tests], -MAX_EVIDENCE, MAX_EVIDENCE)
    number = np.sum([test.informative for test in tests], axis=0)
    total = z.sum(axis=0) / np.sqrt(np.maximum(number, 1))
    return PairTests(
        z=total, p_value=np.minimum(1.0, 2 * ndtr(-np.abs(total))), informative=number > 0
    )


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjust p-values so that the chance of any false finding among them stays bounded.

    Source:
        S. Holm, Scand. J. Stat. 6 (1979) 65.
    """
    values = np.asarray(p_values, float)
    order = np.argsort(values, kind="stable")
    steps = np.minimum(1.0, np.arange(len(values), 0, -1) * values[order])
    adjusted = np.empty_like(values)
    adjusted[order] = np.maximum.accumulate(steps) if len(steps) else steps
    return [float(p) for p in adjusted]


def adjusted(family: Sequence[PairTests]) -> list[Floats]:
    """Return p-values of a family's tests, adjusted such that any false finding is unlikely."""
    sizes = [len(tests.p_value) for tests in family]
    p_values = holm([float(p) for tests in family for p in tests.p_value])
    return np.split(np.array(p_values), np.cumsum(sizes)[:-1])[: len(sizes)]


def rank_models(
    figures: tuple[Floats, Floats], tests: PairTests, p_values: Floats, *, level: float = LEVEL
) -> Ranking:
    """Rank models by their figures, with ties where the tests of pairs show no difference.

    A model is better than another beyond chance when its mean rank is smaller, the evidence
    points the same way, and the adjusted p-value is at most the level's error.

    Args:
        figures: Success rates and indicators, each (T, M) float64, NaN where a model lacks a task.
        tests: Tests of all pairs of models, in the order of `itertools.combinations`.
        p_values: The adjusted p-value of each test.
        level: Confidence level.

    Returns:
        The ranking; models in the order given.

    Source:
        Intervals of places from claims on pairs: M. Mogstad et al., Rev. Econ. Stud. 91 (2024)
        476, section 3.
    """
    mean_rank = (fitted_ranks if np.isnan(figures[0]).any() else mean_ranks)(*figures)
    models = len(mean_rank)
    better = np.zeros((models, models), bool)
    first, second = np.triu_indices(models, 1)
    ahead = mean_rank[second] - mean_rank[first]
    # Rounding must not decide the order.
    claimed = (p_values <= 1 - level) & (ahead * tests.z > 0) & (np.abs(ahead) > ROUNDING)
    won = tests.z > 0
    better[first[claimed & won], second[claimed & won]] = True
    better[second[claimed & ~won], first[claimed & ~won]] = True
    return Ranking(
        mean_rank=mean_rank,
        rank=(1 + better.sum(axis=0)).astype(np.int64),
        high=(models - better.sum(axis=1)).astype(np.int64),
        better=better,
    )
