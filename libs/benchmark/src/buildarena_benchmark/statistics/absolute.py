"""Performance on a scale that does not depend on who else is on a board."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
