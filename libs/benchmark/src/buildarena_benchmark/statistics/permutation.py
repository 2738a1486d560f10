"""Is one model better than another on a task? A permutation test of both figures at once.

Were two models alike, the labels of their pooled trials could be dealt anew without changing
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

MAX_TABLE: Final = 500_000
"""Trials of pairs that are worked on at once: enough to be fast, and a few megabytes."""
MAX_STEPS: Final = 60
"""Newton's steps at most; ten are usual."""
PRECISE: Final = 1e-9
MAX_TILT: Final = 60.0
NEAR_MIDDLE: Final = 0.05
"""Below so many standard deviations the saddlepoint formula is 0 / 0, and the normal one exact."""
FEW: Final = 3
"""A gap between weights makes a lattice when so many trials lie on either side of it."""


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


def pair_tests(pairs: Sequence[tuple[Floats, Floats]]) -> PairTests:
    """Tests each pair's first model against its second on one task.

    The exact distribution is approximated by its double saddlepoint, with a continuity correction
    of half the widest gap between weights. As the test is of models that are alike in everything,
    and models may differ in spread alone, the means must differ by Welch's statistic too.

    Args:
        pairs: For each pair the trials of both, each (n, 2) float64: success and indicator.

    Source:
        J. Robinson, J. R. Stat. Soc. B 44 (1982) 91; I. M. Skovgaard, J. Appl. Probab. 24 (1987)
        875; B. L. Welch, Biometrika 34 (1947) 28.
    """
    if not pairs:
        nothing = np.zeros(0)
        return PairTests(z=nothing, p_value=nothing, informative=nothing.astype(bool))
    longest = max(len(first) + len(second) for first, second in pairs)
    step = max(1, MAX_TABLE // longest)
    found = [_tested(pairs[start : start + step]) for start in range(0, len(pairs), step)]
    return PairTests(
        z=np.concatenate([tests.z for tests in found]),
        p_value=np.concatenate([tests.p_value for tests in found]),
        informative=np.concatenate([tests.informative for tests in found]),
    )


def _tested(pairs: Sequence[tuple[Floats, Floats]]) -> PairTests:
    from scipy.special import ndtr, ndtri

    table = _Weights.of(pairs)
    total = (table.weight * table.first).sum(axis=1)
    moved = np.maximum(0.0, np.abs(total) - table.gap / 2)
    sign = np.sign(total)
    one_sided = _tail(table, moved, sign)
    one_sided = np.maximum(one_sided, ndtr(-_welch(table, total)))
    informative = table.varies
    one_sided = np.where(informative & (moved > 0), np.minimum(one_sided, 0.5), 0.5)
    return PairTests(
        z=sign * -ndtri(np.maximum(one_sided, np.finfo(float).tiny)),
        p_value=np.minimum(1.0, 2 * one_sided),
        informative=informative,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Weights:
    """Pooled trials of P pairs, padded to N: weight 0 and belonging to nobody.

    Attributes:
        weight: (P, N) float64 with mean 0 and, where it varies, standard deviation 1.
        first: (P, N) bool: trials of the first model.
        there: (P, N) bool: trials.
        gap: (P,) float64, widest gap between weights.
        varies: (P,) bool.
    """

    weight: Floats
    first: NDArray[np.bool_]
    there: NDArray[np.bool_]
    gap: Floats
    varies: NDArray[np.bool_]

    @staticmethod
    def of(pairs: Sequence[tuple[Floats, Floats]]) -> _Weights:
        sizes = np.array([(len(first), len(second)) for first, second in pairs])
        longest = int(sizes.sum(axis=1).max())
        place = np.arange(longest)
        there = place < sizes.sum(axis=1)[:, None]
        weight, gap = np.zeros((len(pairs), longest)), np.zeros(len(pairs))
        for number, pair in enumerate(pairs):
            own = _weights(np.concatenate(pair))
            weight[number, : len(own)] = own
            gap[number] = _gap(own)
        return _Weights(
            weight=weight,
            first=place < sizes[:, :1],
            there=there,
            gap=gap,
            varies=np.any(weight != 0.0, axis=1),
        )


def _weights(pooled: Floats) -> Floats:
    """The sum of the standardised figures of (n, F) trials, standardised again."""
    total = np.zeros(len(pooled))
    for figure in pooled.T:
        total += _standardised(figure)
    return _standardised(total)


def _standardised(values: Floats) -> Floats:
    if np.ptp(values) == 0.0:
        return np.zeros_like(values)
    away = values - values.mean()
    spread = float(np.sqrt(np.mean(away**2)))
    # Rounding alone is no difference.
    if spread <= 1e-12 * float(np.abs(values).max()):
        return np.zeros_like(values)
    standard: Floats = away / spread
    return standard


def _gap(weights: Floats) -> float:
    steps = np.diff(np.sort(weights))
    inner = steps[FEW - 1 : len(steps) - FEW + 1]
    if not np.any(inner):
        inner = steps
    return float(inner.max(initial=0.0))


def _tail(table: _Weights, reached: Floats, sign: Floats) -> Floats:
    """The chance that dealt labels give the first model a sum as great, by the saddlepoint.

    A trial falls to the first model with odds exp(s + t w); s and t are chosen such that as many
    do, and with as great a sum, as were observed.
    """
    from scipy.special import ndtr

    weight = table.weight * np.where(sign < 0, -1.0, 1.0)[:, None]
    number, size = table.first.sum(axis=1), table.there.sum(axis=1)
    level = np.log(number / (size - number))
    spread = np.sqrt(number * (size - number) / np.maximum(size - 1, 1))
    shift, tilt = _saddlepoint(weight, table.there, reached, number, level)
    odds = shift[:, None] + tilt[:, None] * weight
    curvature = _curvature(odds, weight, table.there)
    determinant = curvature[0] * curvature[2] - curvature[1] ** 2
    gained = (
        (shift - level) * number
        + tilt * reached
        - np.where(table.there, np.logaddexp(0, odds), 0).sum(axis=1)
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


def _saddlepoint(
    weight: Floats, there: NDArray[np.bool_], reached: Floats, number: Floats, level: Floats
) -> tuple[Floats, Floats]:
    shift, tilt = level.astype(float), np.zeros(len(weight))
    for _ in range(MAX_STEPS):
        odds = shift[:, None] + tilt[:, None] * weight
        chance = np.where(there, 1 / (1 + np.exp(-odds)), 0.0)
        missing = number - chance.sum(axis=1), reached - (weight * chance).sum(axis=1)
        a, b, c = _curvature(odds, weight, there)
        determinant = np.maximum(a * c - b * b, np.finfo(float).tiny)
        steps = (
            (c * missing[0] - b * missing[1]) / determinant,
            (a * missing[1] - b * missing[0]) / determinant,
        )
        # Far from the solution whole steps may overshoot; the function is concave.
        damped = 1 / np.maximum(1.0, np.maximum(np.abs(steps[0]) / 2, np.abs(steps[1])))
        shift = np.clip(shift + damped * steps[0], -MAX_TILT, MAX_TILT)
        tilt = np.clip(tilt + damped * steps[1], 0.0, MAX_TILT)
        if np.all(np.abs(steps[1]) <= PRECISE * (1 + tilt)):
            break
    return shift, tilt


def _curvature(
    odds: Floats, weight: Floats, there: NDArray[np.bool_]
) -> tuple[Floats, Floats, Floats]:
    chance = 1 / (1 + np.exp(-odds))
    variance = np.where(there, chance * (1 - chance), 0.0)
    weighted = variance * weight
    return variance.sum(axis=1), weighted.sum(axis=1), (weighted * weight).sum(axis=1)


def _welch(table: _Weights, total: Floats) -> Floats:
    """Welch's statistic of the weights, at least 0; infinite where neither side varies."""
    sides = table.first, table.there & ~table.first
    counts = [side.sum(axis=1) for side in sides]
    means = [(table.weight * s).sum(axis=1) / n for s, n in zip(sides, counts, strict=True)]
    error = np.zeros(len(total))
    for side, mean, count in zip(sides, means, counts, strict=True):
        squares = (side * (table.weight - mean[:, None]) ** 2).sum(axis=1)
        error += np.where(count > 1, squares / (np.maximum(count - 1, 1) * count), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.abs(means[0] - means[1]) / np.sqrt(error)
    statistic: Floats = np.nan_to_num(found, nan=0.0, posinf=np.inf)
    return statistic
