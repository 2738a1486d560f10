"""Statistics of scored trials: pure functions of arrays, each with its source.

Rates are fractions in [0, 1]. Where a figure does not exist (nothing was tried, nothing varied)
the answer is None, never NaN. Everything random takes a seed and is reproducible.
"""

from buildarena_benchmark.statistics.means import MIN_SUCCESSES, mean_interval
from buildarena_benchmark.statistics.power import ERROR, BoardPower, board_power
from buildarena_benchmark.statistics.proportions import exact_interval, wilson_interval
from buildarena_benchmark.statistics.ranking import mean_ranks

__all__ = [
    "ERROR",
    "MIN_SUCCESSES",
    "BoardPower",
    "board_power",
    "exact_interval",
    "mean_interval",
    "mean_ranks",
    "wilson_interval",
]
