"""Power: which differences of success rates a number of samples can show."""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

from pydantic import with_config

ERROR: Final = 0.05
POWER: Final = 0.8
EVEN: Final = 0.5
TEN_POINTS: Final = 0.1


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class BoardPower:
    """Statistical power of a sweep's board, if the weaker model succeeds in half of its trials."""

    trials: int
    """Trials of each model on each task."""
    min_detectable_effect_per_task: float | None
    """The smallest rise of the success rate, 0 to 1, that four of five such boards claim on one
    task; null when they claim none."""
    overall: float | None
    """The same rise on every task, over all of them."""
    samples_for_10pp_effect: int
    """Trials of each model on each task that show a rise of 0.1 over all tasks."""


def board_power(*, models: int, tasks: int, trials: int) -> BoardPower:
    """Return the power of a board whose pairs of models are all compared, on each task and overall.

    Args:
        models: Number of models; a single one is compared with another that has as many trials.
        trials: Trials of each model on each task.

    Source:
        Bonferroni's bound, which is the first step of Holm's procedure; the tasks' evidence adds up
        as if their trials were one task's.
    """
    claims = math.comb(max(models, 2), 2) * (tasks + 1 if tasks > 1 else 1)
    error = ERROR / claims
    needed = trials_needed(EVEN, EVEN + TEN_POINTS, error=error) or 0
    return BoardPower(
        trials=trials,
        min_detectable_effect_per_task=detectable_difference(EVEN, trials, error=error),
        overall=detectable_difference(EVEN, trials * tasks, error=error),
        samples_for_10pp_effect=math.ceil(needed / tasks),
    )


def trials_needed(
    first: float, second: float, *, error: float = ERROR, power: float = POWER
) -> int | None:
    """Return the trials per model needed to distinguish two success rates; None if equal.

    Source:
        J. Cohen, Statistical Power Analysis (1988), section 6.4: the difference of the rates'
        arcsines has a variance that does not depend on the rates.
    """
    effect = abs(_angle(first) - _angle(second))
    if effect == 0.0:
        return None
    return math.ceil(2 * (_needed(error, power) / effect) ** 2)


def detectable_difference(
    rate: float, trials: int, *, error: float = ERROR, power: float = POWER
) -> float | None:
    """Return the smallest rise above a success rate that trials of each model can show.

    Args:
        rate: Success rate of the weaker model.
        trials: Trials of each model.
        error: Chance of seeing a difference where there is none (two-sided).
        power: Chance of seeing the difference.

    Returns:
        The rise; None when even a rate of 1 would be statistically tied.
    """
    angle = _angle(rate) + _needed(error, power) * math.sqrt(2 / trials)
    return math.sin(angle / 2) ** 2 - rate if angle <= math.pi else None


def _angle(rate: float) -> float:
    return 2 * math.asin(math.sqrt(rate))


def _needed(error: float, power: float) -> float:
    normal = NormalDist()
    return normal.inv_cdf(1 - error / 2) + normal.inv_cdf(power)
