"""What figures of a board are drawn from: failures, refusals, and cost against performance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.leaderboard.cells import counted_tallies
from buildarena_benchmark.leaderboard.tallies import Tally
from buildarena_benchmark.statistics import TokenBin, token_bins


@dataclass(slots=True, kw_only=True)
class FailureRow:
    """How the jobs of one model configuration ended, and what its actions came to.

    Attributes:
        outcomes: Ended jobs by outcome; with its reason where there is one.
        refusals: Refused actions by refusal class.
        actions: Actions, refused ones included.
        refused_actions: Refused actions.
    """

    model: str
    configuration: str
    outcomes: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    actions: int = 0
    refused_actions: int = 0


def failure_row(model: str, configuration: str, tallies: Iterable[Tally]) -> FailureRow:
    """The row of one model configuration, from the tallies of all its cells."""
    row = FailureRow(model=model, configuration=configuration)
    for tally in tallies:
        ended = f"{tally.outcome}: {tally.reason}" if tally.reason else tally.outcome
        row.outcomes[ended] += tally.number
        row.refusals.update(tally.refusals)
        row.actions += tally.actions
        row.refused_actions += tally.refused_actions
    return row


def cost_bins_of(
    tallies: Mapping[str, Iterable[Tally]], *, categories: Mapping[str, str]
) -> dict[str, list[TokenBin]]:
    """Performance relative to the best job of the task, in bins of output tokens, by category.

    Args:
        tallies: Of each task; jobs without known output tokens are left out.
        categories: The category of each task; one without is a category by itself.
    """
    pairs_by_category: dict[str, list[NDArray[np.float64]]] = {}
    for task, task_tallies in tallies.items():
        counted = counted_tallies(task_tallies)
        if not counted:
            continue
        indicators = np.concatenate([tally.indicators for tally in counted])
        tokens = np.concatenate([tally.output_tokens for tally in counted]).astype(np.float64)
        top = max(0.0, float(indicators.max(initial=0.0)))
        relative = indicators / top if top > 0 else np.zeros_like(indicators)
        used = tokens > 0
        pairs = np.stack([tokens[used], relative[used]], axis=1)
        pairs_by_category.setdefault(categories.get(task, task), []).append(pairs)
    return {
        category: _bins(parts)
        for category, parts in pairs_by_category.items()
        if any(map(len, parts))
    }


def _bins(parts: Sequence[NDArray[np.float64]]) -> list[TokenBin]:
    pairs = np.concatenate(parts)
    # Means depend on the order in their last digits; sorted, equal data give equal bins.
    pairs = pairs[np.lexsort(pairs.T)]
    return token_bins(pairs[:, 0], pairs[:, 1])
