"""Power: which differences of success rates a number of samples can show."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Final

ERROR: Final = 0.05
POWER: Final = 0.8


def trials_needed(
    first: float, second: float, *, error: float = ERROR, power: float = POWER
) -> int | None:
    """Trials of each model that are needed to distinguish two success rates; None if equal.

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
    """The smallest rise above a success rate that trials of each model can show.

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
