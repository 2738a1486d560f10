"""Intervals of mean indicators, where few trials or nearly all may have succeeded.

A mean over all trials has two parts: how often trials succeed, and how well those do that did.
Resampling knows only successes that were seen, and misses the truth when these are few. Here each
part has its own interval, and both are put together.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.statistics.proportions import LEVEL, exact_interval

MIN_SUCCESSES: Final = 10
"""Fewest successes for an interval: with fewer, too little is known of their spread, and those of
two designs, one of which is three times as good, may all be of the same."""

Floats = NDArray[np.float64]
Interval = tuple[float, float]


def mean_interval(
    values: Floats, successes: NDArray[np.bool_] | None = None, *, level: float = LEVEL
) -> Interval | None:
    """Return the interval of a mean indicator over all trials, failed ones included.

    Args:
        values: (N,) float64, indicators.
        successes: (N,) bool, which trials succeeded; None for those above 0.
        level: Confidence level.

    Returns:
        Lower and upper end; None when fewer than `MIN_SUCCESSES` trials succeeded.

    Raises:
        ValueError: An indicator is not a number.

    Source:
        The parts are joined by the method of variance estimates recovery: G. Y. Zou & A. Donner,
        Stat. Med. 27 (2008) 1693; for data with many zeros: G. Y. Zou, J. Taleban & C. Y. Huo,
        Comput. Stat. Data Anal. 53 (2009) 3755.
    """
    if not np.all(np.isfinite(values)):
        raise ValueError(f"indicators must be numbers: {values[~np.isfinite(values)][0]}")
    # Sums depend on the order in their last digits; sorted, equal data give equal intervals.
    won = values > 0.0 if successes is None else successes & (values > 0.0)
    gained = np.sort(values[won])
    if len(gained) < MIN_SUCCESSES:
        return None
    low, high = _of_successes(gained, len(values), level)
    remainder = np.sort(np.where(won, 0.0, values))
    if not np.any(remainder):
        return low, high
    part, rest_mean = float(gained.sum()) / len(values), float(remainder.mean())
    other_low, other_high = _of_rest(remainder, level)
    lowest = min(0.0, float(remainder[0]))
    return (
        max(lowest, part + rest_mean - math.hypot(part - low, rest_mean - other_low)),
        part + rest_mean + math.hypot(high - part, other_high - rest_mean),
    )


def _of_successes(gained: Floats, trials: int, level: float) -> Interval:
    """Return what successes add to the mean: their share times their own mean, on a log scale."""
    count = len(gained)
    share = count / trials
    share_low, share_high = exact_interval(
        count, trials, level=level, at_least=min(MIN_SUCCESSES, count)
    )
    down, up = _half_widths(gained, level)
    mean = float(gained.sum()) / trials
    low = mean * math.exp(-math.hypot(math.log(share / share_low), down)) if share_low else 0.0
    return low, mean * math.exp(math.hypot(math.log(share_high / share), up))


def _half_widths(gained: Floats, level: float) -> Interval:
    """Return how far the mean of successes may lie below and above, as logarithms of ratios.

    The widest of three: Student's, which asks for no distribution and is too narrow for few skewed
    values; that of a lognormal mean, which knows of the tail that few values do not show; and
    upwards Student's with one more of the best, which a better design may have been short of.
    """
    from scipy.special import chdtri, stdtrit

    if gained[0] == gained[-1]:
        return 0.0, 0.0
    free = len(gained) - 1
    student = float(stdtrit(free, (1 + level) / 2)) / math.sqrt(len(gained))
    plain = student * float(gained.std(ddof=1)) / float(gained.mean())
    half = float(np.log(gained).var(ddof=1)) / 2
    middle = student * math.sqrt(2 * half)
    more = np.append(gained, gained[-1])
    short = float(more.mean()) + student * math.sqrt(len(gained) / len(more)) * float(
        more.std(ddof=1)
    )
    small, large = (free / float(chdtri(free, tail)) for tail in ((1 - level) / 2, (1 + level) / 2))
    return (
        max(plain, math.hypot(middle, half * (1 - small))),
        max(
            plain,
            math.hypot(middle, half * (large - 1)),
            math.log(short / float(gained.mean())),
        ),
    )


def _of_rest(values: Floats, level: float) -> Interval:
    """Return what failures add to the mean: Student's interval."""
    from scipy.special import stdtrit

    error = float(values.std(ddof=1)) / math.sqrt(len(values))
    half = float(stdtrit(len(values) - 1, (1 + level) / 2)) * error
    mean = float(values.mean())
    return mean - half, mean + half


def cost_per_success(costs_usd: Sequence[float | None], successes: float) -> float | None:
    """Return US dollars spent for each success, failures included.

    Args:
        costs_usd: Cost of each trial; None where it is unknown.
        successes: Number of successes, or the sum of their shares.

    Returns:
        None without a success, or with an unknown cost.
    """
    costs = [cost for cost in costs_usd if cost is not None]
    if not successes or len(costs) < len(costs_usd):
        return None
    return math.fsum(costs) / successes


def expert_scores(indicators: Floats, reference: float) -> Floats:
    """Return the indicators relative to the built-in expert's, on a log scale.

    Nothing is 0, the expert's indicator 1, three times it 2, seven times it 3: each further point
    is about twice as much. Failures count as 0, so a mean of scores is a figure of all
    trials, and one lucky trial cannot carry it as it carries a mean of indicators.

    Args:
        indicators: (N,) float64, of counted trials; below 0 counts as 0.
        reference: The expert's indicator, above 0.

    Returns:
        (N,) float64, at least 0.
    """
    scores: Floats = np.log2(1.0 + np.maximum(indicators, 0.0) / reference)
    return scores
