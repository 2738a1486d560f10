"""Agreement of two simulators (or any two judges) on the same machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

NEAR: Final = 0.25
"""Indicators are near each other when they differ by no more than this share of the larger."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """How far two simulators say the same.

    Attributes:
        trials: Trials that both judged.
        same_verdict: Share on which both said success or both did not.
        kappa: Cohen's kappa of the verdicts: 1 is full agreement, 0 what chance would give; None
            when chance alone would agree always.
        near: Share of those trials that both call a success whose indicators differ by no more than
            a quarter of the larger; None when they never both do.
        rank_correlation: Spearman's correlation of the indicators; None when one of them says
            the same of every trial.
    """

    trials: int
    same_verdict: float
    kappa: float | None
    near: float | None
    rank_correlation: float | None


def agreement(
    first: Sequence[tuple[bool, float]], second: Sequence[tuple[bool, float]]
) -> Agreement | None:
    """Compares success and indicator of the same trials; None without trials.

    Source:
        J. Cohen, Educ. Psychol. Meas. 20 (1960) 37; C. Spearman, Am. J. Psychol. 15 (1904) 72.
    """
    from scipy.stats import spearmanr

    if len(first) != len(second):
        raise ValueError(f"{len(first)} trials cannot be paired with {len(second)}")
    if not first:
        return None
    said_1, said_2 = (np.array([bool(s) for s, _ in side]) for side in (first, second))
    same = float(np.mean(said_1 == said_2))
    chance = float(said_1.mean() * said_2.mean() + (1 - said_1.mean()) * (1 - said_2.mean()))
    values_1, values_2 = (np.array([v for _, v in side], float) for side in (first, second))
    varied = np.ptp(values_1) > 0 and np.ptp(values_2) > 0
    both = [
        abs(left - right) <= NEAR * max(abs(left), abs(right))
        for (good, left), (fine, right) in zip(first, second, strict=True)
        if good and fine
    ]
    return Agreement(
        trials=len(first),
        same_verdict=same,
        kappa=(same - chance) / (1 - chance) if chance < 1 else None,
        near=float(np.mean(both)) if both else None,
        rank_correlation=float(spearmanr(values_1, values_2).statistic) if varied else None,
    )
