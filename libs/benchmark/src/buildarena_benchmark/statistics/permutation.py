"""Permutation test whether one model is better than another on a task, by both figures.

Were two models alike, the labels of their pooled trials could be dealt again without changing
anything. A trial's weight is its standardised success plus its standardised indicator, and the
statistic is the sum of the first model's weights: a large one says that it is better by the two
figures that ranks are made of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MAX_TABLE: Final = 16_384
"""Trials of pairs that are worked on at once: enough to be fast, and they fit into a cache."""
MIN_STEP: Final = 16
"""Tables have widths in such steps, and of about an eighth of themselves: few are padded much."""
MAX_STEPS: Final = 60
"""Newton's steps at most; ten are usual."""
PRECISE: Final = 1e-5
"""Largest last step: as each one's error is about the square of the one before, 1e-10 is left."""
MAX_TILT: Final = 60.0
NEAR_MIDDLE: Final = 0.05
"""Standard deviations below which the saddlepoint formula is 0 / 0, and the normal one exact."""
FEW: Final = 3
"""Number of trials on either side of a gap between weights for which it makes a lattice."""
MANY: Final = 64
"""Distinct trials of a model above which near ones are taken together, which changes the evidence
by less than 0.005 standard deviations, of heavy-tailed indicators too. A published sample of 64
trials is tested as it is."""
NEAR: Final = 1 / 128
"""Largest distance between them, as a share of the range of the model's indicators."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """A model's trials on one task as tests take them: equal ones together.

    Of more than `MANY` distinct trials, those of one success and of indicators in one step of
    `NEAR` count at the mean of their indicators.

    Attributes:
        figures: (D, 2) float64: success and indicator of distinct trials.
        times: (D,) float64: how many trials are like each.
    """

    figures: Floats
    times: Floats

    @staticmethod
    def of(trials: Floats) -> Sample:
        """Return the sample of trials, (N, 2) float64: success, or its share, and indicator."""
        return Sample.of_sorted(trials[np.lexsort(trials.T)])

    @staticmethod
    def of_sorted(ordered: Floats) -> Sample:
        """Return the sample of trials sorted by their indicators, equal ones by their success."""
        first = np.ones(len(ordered), bool)
        first[1:] = np.any(ordered[1:] != ordered[:-1], axis=1)
        times = np.diff(np.append(np.flatnonzero(first), len(ordered))).astype(np.float64)
        sample = Sample(figures=ordered[first], times=times)
        return sample._near_together() if len(times) > MANY else sample

    def _near_together(self) -> Sample:
        success, indicator = self.figures.T
        away = indicator - indicator.min()
        step = np.floor(away / max(away.max(), np.finfo(float).tiny) / NEAR).astype(np.int64)
        _, kind = np.unique(success, return_inverse=True)
        _, place = np.unique(kind * (step.max() + 1) + step, return_inverse=True)
        times = np.bincount(place, self.times).astype(np.float64)
        means = [np.bincount(place, self.times * figure) / times for figure in self.figures.T]
        return Sample(figures=np.stack(means, axis=1), times=times)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairTests:
    """Tests of P pairs of models on one task.

    Attributes:
        z: (P,) float64, evidence that the first is better, in standard deviations of a normal
            figure; negative where the second is better, 0 where nothing varies.
        p_value: (P,) float64, two-sided.
        informative: (P,) bool: whether anything varies.
    """

    z: Floats
    p_value: Floats
    informative: NDArray[np.bool_]

    @staticmethod
    def of(rows: Floats) -> PairTests:
        """Return the tests in (3, P): evidence, p-values, and whether anything varies."""
        return PairTests(z=rows[0], p_value=rows[1], informative=rows[2].astype(bool))


def pair_tests(pairs: Sequence[tuple[Sample, Sample]]) -> PairTests:
    """Test each pair's first model against its second on one task.

    The exact distribution is approximated by its double saddlepoint, with a continuity correction
    of half the widest gap between weights. As the test is of models that are alike in everything,
    and models may differ in spread alone, the means must differ by Welch's statistic too.

    The result for a pair does not depend on the other pairs.

    Args:
        pairs: For each pair the trials of both.

    Source:
        J. Robinson, J. R. Stat. Soc. B 44 (1982) 91; I. M. Skovgaard, J. Appl. Probab. 24 (1987)
        875; B. L. Welch, Biometrika 34 (1947) 28.
    """
    results = np.zeros((3, len(pairs)))
    for width, places in _by_width(pairs).items():
        step = max(1, MAX_TABLE // width)
        for start in range(0, len(places), step):
            some = places[start : start + step]
            results[:, some] = _test([pairs[i] for i in some], width)
    return PairTests.of(results)


def _by_width(pairs: Sequence[tuple[Sample, Sample]]) -> dict[int, list[int]]:
    """Return the indices of pairs by the width of their table, which depends on the pair alone."""
    by_width: dict[int, list[int]] = {}
    for place, (first, second) in enumerate(pairs):
        length = max(1, len(first.times) + len(second.times))
        step = max(MIN_STEP, 1 << max(0, length.bit_length() - 4))
        by_width.setdefault(-(-length // step) * step, []).append(place)
    return by_width


def _test(pairs: Sequence[tuple[Sample, Sample]], width: int) -> Floats:
    """Return evidence, p-value and whether anything varies: (3, P) float64."""
    from scipy.special import ndtr, ndtri

    table = _Weights.of(pairs, width)
    total = _sums(table.weight, table.first)
    moved = np.maximum(0.0, np.abs(total) - table.gap / 2)
    sign = np.sign(total)
    one_sided = _tail(table, moved, sign)
    one_sided = np.maximum(one_sided, ndtr(-_welch(table, total)))
    informative = table.varies
    one_sided = np.where(informative & (moved > 0), np.minimum(one_sided, 0.5), 0.5)
    z = sign * -ndtri(np.maximum(one_sided, np.finfo(float).tiny))
    return np.stack([z, np.minimum(1.0, 2 * one_sided), informative.astype(float)])


def _sums(weight: Floats, times: Floats) -> Floats:
    """Return each row's sum of products."""
    return np.asarray(np.einsum("pn,pn->p", weight, times), float)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Weights:
    """Pooled distinct trials of P pairs, padded to N with one of count 0.

    Attributes:
        weight: (P, N) float64 with mean 0 and, where it varies, standard deviation 1.
        first: (P, N) float64: how many trials of the first model have each weight.
        second: (P, N) float64: how many trials of the second have it.
        gap: (P,) float64, widest gap between weights.
        varies: (P,) bool.
    """

    weight: Floats
    first: Floats
    second: Floats
    gap: Floats
    varies: NDArray[np.bool_]

    @staticmethod
    def of(pairs: Sequence[tuple[Sample, Sample]], width: int) -> _Weights:
        figures = np.zeros((2, len(pairs), width))
        first, second = np.zeros((len(pairs), width)), np.zeros((len(pairs), width))
        for number, (left, right) in enumerate(pairs):
            middle, end = len(left.times), len(left.times) + len(right.times)
            figures[:, number, :middle] = left.figures.T
            figures[:, number, middle:end] = right.figures.T
            figures[:, number, end:] = figures[:, number, :1]
            first[number, :middle] = left.times
            second[number, middle:end] = right.times
        times = first + second
        for figure in figures:
            _standardise(figure, times)
        weight = figures[0] + figures[1]
        _standardise(weight, times)
        return _Weights(
            weight=weight,
            first=first,
            second=second,
            gap=_gaps(weight, times),
            varies=np.any(weight != 0.0, axis=1),
        )


def _standardise(values: Floats, times: Floats) -> None:
    """Give each row mean 0 and standard deviation 1; zeros where a row does not vary."""
    number = np.maximum(times.sum(axis=1), 1.0)
    largest, smallest = values.max(axis=1), values.min(axis=1)
    values -= (_sums(values, times) / number)[:, None]
    spread = np.sqrt(np.einsum("pn,pn,pn->p", values, values, times) / number)
    # Rounding alone is not a difference.
    rounding = 1e-12 * np.maximum(np.abs(largest), np.abs(smallest))
    varies = (largest > smallest) & (spread > rounding)
    values *= np.where(varies, 1.0 / np.where(varies, spread, 1.0), 0.0)[:, None]


def _gaps(weight: Floats, times: Floats) -> Floats:
    """Return the widest gap between each row's weights."""
    order = np.argsort(weight, axis=1, kind="stable")
    steps = np.diff(np.take_along_axis(weight, order, axis=1), axis=1)
    below = np.cumsum(np.take_along_axis(times, order, axis=1), axis=1)[:, :-1]
    above = times.sum(axis=1)[:, None] - below
    inner = np.where((below >= FEW) & (above >= FEW), steps, 0.0).max(axis=1, initial=0.0)
    widest: Floats = np.where(inner > 0, inner, steps.max(axis=1, initial=0.0))
    return widest


def _tail(table: _Weights, reached: Floats, sign: Floats) -> Floats:
    """Return the chance that dealt labels give the first model a sum as great, by the saddlepoint.

    A trial falls to the first model with odds exp(s + t w); s and t are chosen such that as many
    do, and with as great a sum, as were observed.
    """
    from scipy.special import ndtr

    weight = table.weight * np.where(sign < 0, -1.0, 1.0)[:, None]
    times = table.first + table.second
    number, size = table.first.sum(axis=1), times.sum(axis=1)
    level = np.log(number / (size - number))
    spread = np.sqrt(number * (size - number) / np.maximum(size - 1, 1))
    shift, tilt = _saddlepoint(weight, times, reached, number, level)
    odds = shift[:, None] + tilt[:, None] * weight
    sums = _deal(shift, tilt, weight, times)
    determinant = sums.variance * sums.squares - sums.products**2
    gained = (
        (shift - level) * number
        + tilt * reached
        - _sums(_log_of_one_more(odds), times)
        + size * np.logaddexp(0, level)
    )
    root = np.sqrt(2 * np.maximum(gained, 0.0))
    at_rest = number * (size - number) / size
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = tilt * np.sqrt(np.maximum(determinant, 0.0) / at_rest)
        saddle = root + np.log(scale / root) / root
    normal = reached / spread
    usable = (root > NEAR_MIDDLE) & np.isfinite(saddle)
    return np.asarray(ndtr(-np.where(usable, saddle, normal)), float)


def _log_of_one_more(odds: Floats) -> Floats:
    """Return log(1 + exp(odds)), several times as fast as `logaddexp`."""
    above: Floats = np.maximum(odds, 0.0)
    return above + np.log(1.0 + np.exp(-np.abs(odds)))


def _saddlepoint(
    weight: Floats, times: Floats, reached: Floats, number: Floats, level: Floats
) -> tuple[Floats, Floats]:
    # The first step from no tilt, where weights have mean 0 and standard deviation 1.
    size = times.sum(axis=1)
    tilt = np.minimum(reached * size / (number * (size - number)), 2.0)
    shift = level.astype(float)
    open_ = np.arange(len(weight))
    for _ in range(MAX_STEPS):
        own = shift[open_], tilt[open_]
        moments = _deal(*own, weight, times)
        missing = number[open_] - moments.number, reached[open_] - moments.reached
        a, b, c = moments.variance, moments.products, moments.squares
        determinant = np.maximum(a * c - b * b, np.finfo(float).tiny)
        steps = (
            (c * missing[0] - b * missing[1]) / determinant,
            (a * missing[1] - b * missing[0]) / determinant,
        )
        # Far from the solution whole steps may overshoot; the function is concave.
        damped = 1 / np.maximum(1.0, np.maximum(np.abs(steps[0]) / 2, np.abs(steps[1])))
        shift[open_] = np.clip(own[0] + damped * steps[0], -MAX_TILT, MAX_TILT)
        tilt[open_] = np.clip(own[1] + damped * steps[1], 0.0, MAX_TILT)
        # Each pair stops by itself, so that no other pair can show in its last digit.
        unconverged = np.abs(steps[1]) > PRECISE * (1 + tilt[open_])
        if not np.all(unconverged):
            open_, weight, times = open_[unconverged], weight[unconverged], times[unconverged]
        if not len(open_):
            break
    return shift, tilt


@dataclass(frozen=True, slots=True, kw_only=True)
class _Split:
    """Moments of randomly dealt labels, each (P,) float64.

    Attributes:
        number: Trials that fall to the first model.
        reached: Sum of their weights.
        products: Covariance of number and sum.
        squares: Variance of the sum.
    """

    number: Floats
    reached: Floats
    variance: Floats
    products: Floats
    squares: Floats


def _deal(shift: Floats, tilt: Floats, weight: Floats, times: Floats) -> _Split:
    # In place: most of a board's time is spent here, and memory is slower than arithmetic.
    chance = weight * -tilt[:, None]
    chance -= shift[:, None]
    np.exp(chance, out=chance)
    chance += 1.0
    np.reciprocal(chance, out=chance)
    expected = chance * times
    number, reached = expected.sum(axis=1), _sums(expected, weight)
    np.subtract(1.0, chance, out=chance)
    expected *= chance
    variance = expected.sum(axis=1)
    expected *= weight
    return _Split(
        number=number,
        reached=reached,
        variance=variance,
        products=expected.sum(axis=1),
        squares=_sums(expected, weight),
    )


def _welch(table: _Weights, total: Floats) -> Floats:
    """Return Welch's statistic of the weights, at least 0; infinite where neither side varies."""
    sides = table.first, table.second
    counts = [side.sum(axis=1) for side in sides]
    means = [_sums(table.weight, s) / n for s, n in zip(sides, counts, strict=True)]
    error = np.zeros(len(total))
    for side, mean, count in zip(sides, means, counts, strict=True):
        squares = _sums((table.weight - mean[:, None]) ** 2, side)
        error += np.where(count > 1, squares / (np.maximum(count - 1, 1) * count), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(means[0] - means[1]) / np.sqrt(error)
    statistic: Floats = np.nan_to_num(ratio, nan=0.0, posinf=np.inf)
    return statistic
