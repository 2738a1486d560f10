"""Statistics of scored trials: pure functions of arrays, each with its source.

Rates are fractions in [0, 1]. Where a figure does not exist (nothing was tried, nothing varied)
the answer is None, never NaN. Everything random takes a seed and is reproducible.
"""

from buildarena_benchmark.statistics.means import (
    MIN_SUCCESSES,
    cost_per_success,
    expert_scores,
    mean_interval,
)
from buildarena_benchmark.statistics.permutation import PairTests, Sample, pair_tests
from buildarena_benchmark.statistics.power import (
    ERROR,
    BoardPower,
    board_power,
    detectable_difference,
    trials_needed,
)
from buildarena_benchmark.statistics.proportions import (
    difference_interval,
    exact_interval,
    mean_rate_interval,
    pass_at_k,
    pass_hat_k,
    wilson_interval,
)
from buildarena_benchmark.statistics.ranking import (
    Ranking,
    adjusted,
    combined,
    fitted_ranks,
    holm,
    mean_ranks,
    rank_models,
)

__all__ = [
    "ERROR",
    "MIN_SUCCESSES",
    "BoardPower",
    "PairTests",
    "Ranking",
    "Sample",
    "adjusted",
    "board_power",
    "combined",
    "cost_per_success",
    "detectable_difference",
    "difference_interval",
    "exact_interval",
    "expert_scores",
    "fitted_ranks",
    "holm",
    "mean_interval",
    "mean_ranks",
    "mean_rate_interval",
    "pair_tests",
    "pass_at_k",
    "pass_hat_k",
    "rank_models",
    "trials_needed",
    "wilson_interval",
]
