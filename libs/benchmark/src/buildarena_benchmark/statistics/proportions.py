"""Success rates: their intervals, their differences, and what k tries would bring."""

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEVEL: Final = 0.95
"""Confidence level of every interval that is shown."""


def exact_interval(
    successes: float, trials: int, level: float = LEVEL, *, at_least: int = 0
) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a success rate; its level is a least coverage.

    Args:
        successes: Number of successes. Trials may be worth a share from 0 to 1 each: their mean
            varies at most as much as that of trials that succeed or fail with the same chance.
        level: Confidence level.
        at_least: Successes without which no interval would be computed. Seeing so many
            is then little evidence, and the lower end takes it for given.

    Raises:
        ValueError: There were no trials, more successes than trials, or fewer than were asked for.

    Source:
        C. J. Clopper & E. S. Pearson, Biometrika 26 (1934) 404; of shares: W. Hoeffding, J. Am.
        Stat. Assoc. 58 (1963) 13.
    """
    from scipy.special import betaincinv

    if not at_least <= successes <= trials or trials == 0:
        raise ValueError(f"{successes} successes of {trials} trials have no interval")
    tail = (1 - level) / 2
    low, high = 0.0, 1.0
    if successes > at_least:
        low = float(betaincinv(successes, trials - successes + 1, tail))
    if 0 < at_least < successes:
        low = _conditional_low(successes, trials, at_least, tail, upper=low)
    if successes < trials:
        high = float(betaincinv(successes + 1, trials - successes, 1 - tail))
    return low, high


def mean_rate_interval(rates: Sequence[tuple[float, int]]) -> tuple[float, float]:
    """Return the exact interval of the mean of several tasks' success rates.

    As wide as with the fewest trials of any task on each: whatever the single chances are, the
    mean varies at most as much as that of so many trials with one chance.

    Args:
        rates: Success rate and trials of each task.

    Source:
        W. Hoeffding, Ann. Math. Stat. 27 (1956) 713; see also `exact_interval`.
    """
    fewest = min(trials for _, trials in rates)
    successes = fewest * math.fsum(rate for rate, _ in rates)
    return exact_interval(min(successes, fewest * len(rates)), fewest * len(rates))


def _conditional_low(
    successes: float, trials: int, at_least: int, tail: float, *, upper: float
) -> float:
    """Return the rate at which so many successes, given at least some, have the tail's chance."""
    from scipy.optimize import brentq
    from scipy.special import betainc

    def excess(rate: float) -> float:
        any_success = float(betainc(at_least, trials - at_least + 1, rate))
        if any_success == 0.0:
            return -tail
        return float(betainc(successes, trials - successes + 1, rate)) / any_success - tail

    return float(brentq(excess, 0.0, upper)) if excess(upper) > 0 else upper


def wilson_interval(successes: float, trials: int, level: float = LEVEL) -> tuple[float, float]:
    """Return the Wilson score interval of a success rate; it never leaves [0, 1].

    Raises:
        ValueError: There were no trials, or more successes than trials.

    Source:
        E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise ValueError(f"{successes} successes of {trials} trials have no interval")
    z = NormalDist().inv_cdf(0.5 + level / 2)
    rate, square = successes / trials, z**2
    centre = (rate + square / (2 * trials)) / (1 + square / trials)
    spread = math.sqrt(rate * (1 - rate) / trials + square / (4 * trials**2))
    half = z * spread / (1 + square / trials)
    # At the ends the formula gives exactly 0 or 1; rounding must not make it miss them.
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == trials else min(1.0, centre + half)
    return low, high


def difference_interval(
    first: tuple[float, int], second: tuple[float, int], level: float = LEVEL
) -> tuple[float, float]:
    """Return the interval of the difference of two independent success rates, first minus second.

    Args:
        first: Successes and trials of the first.
        second: Successes and trials of the second.
        level: Confidence level.

    Source:
        R. G. Newcombe, Stat. Med. 17 (1998) 873, method 10 (hybrid score).
    """
    (low_1, high_1), (low_2, high_2) = (
        wilson_interval(*first, level=level),
        wilson_interval(*second, level=level),
    )
    rate_1, rate_2 = first[0] / first[1], second[0] / second[1]
    difference = rate_1 - rate_2
    return (
        difference - math.hypot(rate_1 - low_1, high_2 - rate_2),
        difference + math.hypot(high_1 - rate_1, rate_2 - low_2),
    )


def pass_at_k(shares: ArrayLike, k: int) -> float | None:
    """Return the chance that at least one of k tries succeeds; None when fewer than k were made.

    Unbiased: the share of all k-subsets of the trials that hold a success.

    Args:
        shares: (N,) 0 or 1 for each trial, or the chance with which it succeeds.

    Source:
        M. Chen et al., arXiv:2107.03374 (2021), equation 1.
    """
    missed = _mean_product(1.0 - np.asarray(shares, np.float64), k)
    return None if missed is None else 1.0 - missed


def pass_hat_k(shares: ArrayLike, k: int) -> float | None:
    """Return the chance that all of k tries succeed; None when fewer than k were made.

    Unbiased: the share of all k-subsets of the trials that hold successes alone.

    Args:
        shares: (N,) 0 or 1 for each trial, or the chance with which it succeeds.

    Source:
        S. Yao et al., arXiv:2406.12045 (2024), section 3 (pass^k).
    """
    return _mean_product(np.asarray(shares, np.float64), k)


def _mean_product(values: NDArray[np.float64], k: int) -> float | None:
    """Return the mean product of k different values; None when there are fewer."""
    number = len(values)
    if not 1 <= k <= number:
        return None
    ones = int(np.count_nonzero(values == 1.0))
    if ones + int(np.count_nonzero(values == 0.0)) == number:
        return float(math.comb(ones, k)) / math.comb(number, k)
    # The coefficients of the product of (1 + value x) are sums of products; many values are equal.
    sums = [1.0]
    for value, times in zip(*np.unique(values, return_counts=True), strict=True):
        powers = [math.comb(int(times), j) * float(value) ** j for j in range(k + 1)]
        sums = [
            math.fsum(sums[i] * powers[j - i] for i in range(min(j + 1, len(sums))))
            for j in range(k + 1)
        ]
    return sums[k] / math.comb(number, k)
