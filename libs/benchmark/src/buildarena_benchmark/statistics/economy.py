"""Performance beside the expert's, and what a success costs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def cost_per_success(costs_usd: Sequence[float | None], successes: float) -> float | None:
    """US dollars spent for each success, failures included.

    Args:
        costs_usd: Cost of each trial; None where it is unknown.
        successes: How many of them succeeded, or the sum of their shares.

    Returns:
        None without a success, or with an unknown cost.
    """
    known = [cost for cost in costs_usd if cost is not None]
    if not successes or len(known) < len(costs_usd):
        return None
    return math.fsum(known) / successes


def expert_scores(indicators: Floats, reference: float) -> Floats:
    """Return the indicators beside the built-in expert's, on a log scale.

    Nothing is 0, the expert's indicator 1, three times it 2, seven times it 3: each further point
    stands for about twice as much. Failures count as 0, so a mean of scores is a figure of all
    trials, and one lucky trial cannot carry it as it carries a mean of indicators.

    Args:
        indicators: (N,) float64, of counted trials; below 0 counts as 0.
        reference: The expert's indicator, above 0.

    Returns:
        (N,) float64, at least 0.
    """
    scores: Floats = np.log2(1.0 + np.maximum(indicators, 0.0) / reference)
    return scores
