"""Statistics of scored trials: pure functions of arrays, each with its source.

Rates are fractions in [0, 1]. Where a figure does not exist (nothing was tried, nothing varied)
the answer is None, never NaN. Everything random takes a seed and is reproducible.
"""

from buildarena_benchmark.statistics.means import MIN_SUCCESSES as MIN_SUCCESSES
from buildarena_benchmark.statistics.means import cost_per_success as cost_per_success
from buildarena_benchmark.statistics.means import mean_interval as mean_interval
from buildarena_benchmark.statistics.permutation import Sample as Sample
from buildarena_benchmark.statistics.permutation import pair_tests as pair_tests
from buildarena_benchmark.statistics.power import ERROR as ERROR
from buildarena_benchmark.statistics.power import BoardPower as BoardPower
from buildarena_benchmark.statistics.power import board_power as board_power
from buildarena_benchmark.statistics.power import detectable_difference as detectable_difference
from buildarena_benchmark.statistics.power import trials_needed as trials_needed
from buildarena_benchmark.statistics.proportions import difference_interval as difference_interval
from buildarena_benchmark.statistics.proportions import exact_interval as exact_interval
from buildarena_benchmark.statistics.proportions import mean_rate_interval as mean_rate_interval
from buildarena_benchmark.statistics.proportions import pass_at_k as pass_at_k
from buildarena_benchmark.statistics.proportions import pass_hat_k as pass_hat_k
from buildarena_benchmark.statistics.proportions import wilson_interval as wilson_interval
from buildarena_benchmark.statistics.ranking import holm as holm
from buildarena_benchmark.statistics.ranking import mean_ranks as mean_ranks
from buildarena_benchmark.statistics.ranking import rank_models as rank_models
