"""Made-up trials of models whose true figures are known: what intervals and claims are tried on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.statistics import mean_interval
from buildarena_benchmark.statistics.permutation import Sample, pair_tests
from buildarena_benchmark.statistics.ranking import Ranking, adjusted, combined, rank_models

Floats = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], Floats]
Board = Sequence[Sequence[Floats]]
"""By task and model: (n, 2) float64, success and indicator of each trial."""

LIMIT = 1500.0


@dataclass(frozen=True, slots=True)
class Loads:
    """Indicators of successes, and their true mean."""

    draw: Draw
    mean: float


def lognormal(sigma: float) -> Loads:
    """Loads whose logarithms are normal about that of 250."""
    mean = 250 * float(np.exp(sigma**2 / 2))
    return Loads(lambda rng, n: 250 * np.exp(rng.normal(0, sigma, n)), mean)


def _measured(draw: Draw) -> Loads:
    return Loads(draw, float(draw(np.random.default_rng(0), 4_000_000).mean()))


def _censored(rng: np.random.Generator, n: int) -> Floats:
    return np.minimum(900 * np.exp(rng.normal(0, 0.8, n)), LIMIT)


def _split(share: float, most: float) -> Draw:
    def draw(rng: np.random.Generator, n: int) -> Floats:
        return np.where(rng.random(n) < share, LIMIT, rng.uniform(50, most, n))

    return draw


def _designs(share: float, ratio: float) -> Loads:
    """Loads of two designs: this share of the successes is of one that carries so much more."""

    def draw(rng: np.random.Generator, n: int) -> Floats:
        return np.where(rng.random(n) < share, ratio, 1.0) * 100 * np.exp(rng.normal(0, 0.15, n))

    return Loads(draw, 100 * (1 - share + share * ratio) * float(np.exp(0.15**2 / 2)))


LOADS: Mapping[str, Loads] = {
    "lognormal, sigma 0.3": lognormal(0.3),
    "lognormal, sigma 0.8": lognormal(0.8),
    "lognormal, sigma 1.2": lognormal(1.2),
    "censored at 1500": _measured(_censored),
    "near constant": Loads(lambda rng, n: 300 + rng.normal(0, 0.01, n), 300.0),
    "uniform": Loads(lambda rng, n: rng.uniform(10, 200, n), 105.0),
    "exponential": Loads(lambda rng, n: rng.exponential(300, n), 300.0),
    "half at 1500": Loads(_split(0.5, 500), 0.5 * LIMIT + 0.5 * 275),
    "two designs, 3 to 1, a quarter": _designs(0.25, 3),
    "two designs, 3 to 1, half": _designs(0.5, 3),
    "two designs, 10 to 1, half": _designs(0.5, 10),
}
"""Loads for which intervals promise to hold."""
RARE = Loads(_split(0.1, 200), 0.1 * LIMIT + 0.9 * 125)
"""Successes of which few are far better: what was not seen is in no interval."""

SIZES = (8, 16, 32, 64, 256)
RATES = (0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """How often an interval was shown, and held the truth when it was."""

    shown: float
    covered: float | None


def coverage(
    loads: Loads,
    trials: int,
    rate: float,
    *,
    samples: int,
    seed: int,
    failures: float = 0.0,
) -> Coverage:
    """Tries intervals of mean indicators."""
    rng = np.random.default_rng(seed)
    truth = rate * loads.mean + (1 - rate) * failures / 2
    shown = covered = 0
    for _ in range(samples):
        won = rng.random(trials) < rate
        values = np.where(won, loads.draw(rng, trials), rng.uniform(0, failures, trials))
        ends = mean_interval(values, won)
        if ends is not None:
            shown += 1
            covered += ends[0] <= truth <= ends[1]
    return Coverage(shown=shown / samples, covered=covered / shown if shown else None)


def board(
    rng: np.random.Generator, rates: Floats, sizes: Sequence[int], loads: Sequence[Loads]
) -> Board:
    """A board of made-up trials."""
    return [
        [
            np.column_stack([won, won * load.draw(rng, size)])
            for rate, size, load in zip(row, sizes, loads, strict=True)
            for won in [(rng.random(size) < rate).astype(float)]
        ]
        for row in rates
    ]


def rankings(made: Board) -> list[Ranking]:
    """The ranking on each task and, last, over all: what a leaderboard claims."""
    rows = [[Sample.of(trials) for trials in row] for row in made]
    tests = [pair_tests(list(combinations(row, 2))) for row in rows]
    every = [*tests, combined(tests)]
    tables = [*([row] for row in made), made]
    told = zip(tables, every, adjusted(every), strict=True)
    return [rank_models(_means(table), test, p_values) for table, test, p_values in told]


def _means(table: Board) -> tuple[Floats, Floats]:
    success, indicator = (
        np.array([[cell[:, figure].mean() for cell in row] for row in table]) for figure in (0, 1)
    )
    return success, indicator
