"""Tests of one model against another, where both were tried with the same seeds.

Paired tests only: models that were given different seeds get an interval of their difference
(`difference_interval`) and no p-value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import with_config


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """A two-sided test of paired trials on shared seeds."""

    method: Literal["exact McNemar", "Wilcoxon signed-rank"]
    pairs: int
    """Seeds that both models were tried with."""
    difference: float
    """Mean of first minus second."""
    p_value: float
    """Chance of a difference as great if the models were alike."""


def paired_successes(first: Sequence[float], second: Sequence[float]) -> PairedTest | None:
    """Return the exact McNemar test of success on shared seeds; None without pairs.

    Only seeds on which one succeeded and the other did not speak; under equality each of these
    falls to either side with chance 1/2. Shares of varied worlds, which may lie between 0 and 1,
    are tested as indicators are.

    Source:
        Q. McNemar, Psychometrika 12 (1947) 153; exact form by the binomial distribution.
    """
    from scipy.stats import binomtest

    pairs = list(zip(first, second, strict=True))
    if not pairs:
        return None
    if any(0 < share < 1 for pair in pairs for share in pair):
        return paired_indicators(first, second)
    won = sum(a > b for a, b in pairs)
    lost = sum(b > a for a, b in pairs)
    p_value = float(binomtest(won, won + lost, 0.5).pvalue) if won + lost else 1.0
    return PairedTest(
        pairs=len(pairs),
        difference=(won - lost) / len(pairs),
        p_value=p_value,
        method="exact McNemar",
    )


def paired_indicators(first: Sequence[float], second: Sequence[float]) -> PairedTest | None:
    """Return the Wilcoxon signed-rank test of indicators on shared seeds; None without pairs.

    Pratt's treatment of zero differences: failures of both are frequent and must not be dropped
    before ranks are given.

    Source:
        J. W. Pratt, J. Am. Stat. Assoc. 54 (1959) 655.
    """
    from scipy.stats import wilcoxon

    difference = np.asarray(first, float) - np.asarray(second, float)
    if not difference.size:
        return None
    p_value = 1.0
    if np.any(difference):
        # The exact distribution knows no ties or zeros, and failures make both.
        method = "exact" if _has_no_ties(difference) and len(difference) <= 50 else "asymptotic"  # noqa: PLR2004 - SciPy's own bound
        p_value = float(wilcoxon(difference, zero_method="pratt", method=method).pvalue)
    return PairedTest(
        pairs=len(difference),
        difference=float(difference.mean()),
        p_value=p_value,
        method="Wilcoxon signed-rank",
    )


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values adjusted so that the chance of any false finding among them stays bounded.

    Source:
        S. Holm, Scand. J. Stat. 6 (1979) 65.
    """
    values = np.asarray(p_values, float)
    order = np.argsort(values, kind="stable")
    steps = np.minimum(1.0, np.arange(len(values), 0, -1) * values[order])
    adjusted = np.empty_like(values)
    adjusted[order] = np.maximum.accumulate(steps) if len(steps) else steps
    return [float(p) for p in adjusted]


def _has_no_ties(difference: NDArray[np.float64]) -> bool:
    sizes = np.abs(difference)
    return bool(np.all(sizes > 0)) and len(np.unique(sizes)) == len(sizes)
