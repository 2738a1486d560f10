"""Performance beside the expert's, and cost against performance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TokenBin:
    """Trials whose sessions wrote about as much.

    Attributes:
        low: Fewest output tokens, included.
        high: Most output tokens, excluded (included in the last bin).
        trials: Trials in it.
        mean: Mean normalised performance; None when it is empty.
        median: Median of it; None when it is empty.
    """

    low: float
    high: float
    trials: int
    mean: float | None
    median: float | None


def token_bins(output_tokens: Floats, indicators: Floats, *, bins: int = 8) -> list[TokenBin]:
    """Normalised performance in bins of output tokens, of equal width on a log scale.

    The best single trial has performance 1 and all others are relative to it. Sessions that
    wrote nothing fall into the first bin.

    Args:
        output_tokens: (N,) float64, of each trial.
        indicators: (N,) float64, of each trial of one task.
        bins: How many bins.

    Returns:
        The bins in order; empty when there are no trials.

    Source:
        Figure on cost analysis of the BuildArena paper: mean and median in each bin.
    """
    if not len(output_tokens):
        return []
    best = float(indicators.max())
    performance = indicators / best if best > 0 else np.zeros_like(indicators)
    tokens = np.maximum(output_tokens, 1.0)
    low, high = math.log10(tokens.min()), math.log10(tokens.max())
    edges = np.logspace(low, high, bins + 1) if high > low else np.array([tokens[0], tokens[0]])
    edges[0], edges[-1] = tokens.min(), tokens.max()
    place = np.clip(np.searchsorted(edges, tokens, side="right") - 1, 0, len(edges) - 2)
    binned = []
    for number in range(len(edges) - 1):
        inside = performance[place == number]
        binned.append(
            TokenBin(
                low=float(edges[number]),
                high=float(edges[number + 1]),
                trials=len(inside),
                mean=float(inside.mean()) if len(inside) else None,
                median=float(np.median(inside)) if len(inside) else None,
            )
        )
    return binned


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
    """Indicators beside the built-in expert's, on a log scale.

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
