"""What figures of a board are drawn from: failures, refusals, and cost against performance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from buildarena_benchmark.flags import Reading
from buildarena_benchmark.leaderboard.cells import counted_trials
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
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


def failure_rows(trials: Iterable[EndedJob]) -> list[FailureRow]:
    """A row for each model configuration, in the order of their first jobs."""
    rows: dict[tuple[str, str], FailureRow] = {}
    for trial in trials:
        key = (trial.model, trial.configuration)
        row = rows.setdefault(key, FailureRow(model=key[0], configuration=key[1]))
        row.outcomes[f"{trial.outcome}: {trial.reason}" if trial.reason else trial.outcome] += 1
        row.refusals.update(trial.refusals)
        row.actions += trial.actions
        row.refused_actions += trial.refused_actions
    return list(rows.values())


def cost_bins(
    trials: Sequence[EndedJob], *, reading: Reading, categories: Mapping[str, str]
) -> dict[str, list[TokenBin]]:
    """Performance relative to the best job of the task, in bins of output tokens, by category.

    Args:
        trials: Ended jobs; those without known output tokens are left out.
        reading: How flags are read.
        categories: The category of each task; one without is a category by itself.
    """
    counted = counted_trials(trials, reading=reading)
    best: dict[str, float] = {}
    for trial in counted:
        best[trial.task] = max(best.get(trial.task, 0.0), trial.indicator)
    found: dict[str, list[tuple[float, float]]] = {}
    for trial in counted:
        if trial.output_tokens:
            top = best[trial.task]
            relative = trial.indicator / top if top > 0 else 0.0
            category = categories.get(trial.task, trial.task)
            found.setdefault(category, []).append((float(trial.output_tokens), relative))
    return {
        category: token_bins(np.array([t for t, _ in pairs]), np.array([p for _, p in pairs]))
        for category, pairs in found.items()
    }
