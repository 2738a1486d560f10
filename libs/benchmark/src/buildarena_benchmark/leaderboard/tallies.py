"""Tallies: the trials of one cell without their names, reduced to the inputs of its figures."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.outcomes import SCORED

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

UNKNOWN_TOKENS: Final = -1
"""An unknown number of tokens, requests or parts, in arrays."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Total:
    """A sum over the trials that have a value."""

    known: int = 0
    sum: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tally:
    """Trials of one cell that ended alike. A cell of thousands of trials has a few of these.

    Attributes:
        reason: Class of their failure, if any.
        ran_on_runner: Whether runners ran some of their trials.
        unverified: Whether their verification is open or refuted them.
        shares: (N,) float64, 0 to 1, share of its worlds that each trial passed.
        indicators: (N,) float64, mean indicator of each trial over its worlds.
        costs_usd: (N,) float64, of each trial; not a number where unknown.
        output_tokens: (N,) int64, of each trial; -1 where unknown.
        actions: Actions, refused ones included.
        refusals: Refused actions by refusal class.
    """

    outcome: str
    reason: str | None
    flags: tuple[str, ...]
    ran_on_runner: bool
    unverified: bool
    shares: Floats
    indicators: Floats
    costs_usd: Floats
    output_tokens: Integers
    requests: Total
    input_tokens: Total
    parts: Total
    test_trials: Total
    actions: int
    refused_actions: int
    refusals: Mapping[str, int]
    newest: datetime | None

    @property
    def number(self) -> int:
        """Number of trials it holds."""
        return len(self.indicators)

    @property
    def scored(self) -> bool:
        """True if its trials count in averages."""
        return self.outcome in SCORED and not self.unverified


def total_of(values: Integers) -> Total:
    """Return the sum of those that are known."""
    counted = values[values != UNKNOWN_TOKENS]
    return Total(known=len(counted), sum=int(counted.sum()))


Kind = tuple[str, str | None, tuple[str, ...], bool, bool]
"""Properties that trials of one tally share: outcome to flags, ran_on_runner, unverified."""


def tally_jobs(trials: Iterable[EndedJob]) -> list[Tally]:
    """Return the tallies of one cell's trials, regardless of their order."""
    kinds: dict[Kind, list[EndedJob]] = {}
    for trial in trials:
        kinds.setdefault(_kind(trial), []).append(trial)
    return [_tally(kind, jobs) for kind, jobs in kinds.items()]


def _kind(trial: EndedJob) -> Kind:
    return (
        trial.outcome,
        trial.reason,
        trial.flags,
        trial.ran_on_runner,
        trial.unverified,
    )


def _tally(kind: Kind, trials: list[EndedJob]) -> Tally:
    outcome, reason, flags, ran_on_runner, unverified = kind
    refusals: Counter[str] = Counter()
    for trial in trials:
        refusals.update(trial.refusals)
    return Tally(
        outcome=outcome,
        reason=reason,
        flags=flags,
        ran_on_runner=ran_on_runner,
        unverified=unverified,
        shares=np.array([trial.success for trial in trials], np.float64),
        indicators=np.array([trial.gained for trial in trials], np.float64),
        costs_usd=np.array(
            [np.nan if t.cost_usd is None else t.cost_usd for t in trials], np.float64
        ),
        output_tokens=np.array(
            [UNKNOWN_TOKENS if t.output_tokens is None else t.output_tokens for t in trials],
            np.int64,
        ),
        requests=_total(trial.requests for trial in trials),
        input_tokens=_total(trial.input_tokens for trial in trials),
        parts=_total(trial.parts for trial in trials),
        test_trials=_total(trial.test_trials for trial in trials),
        actions=sum(trial.actions for trial in trials),
        refused_actions=sum(trial.refused_actions for trial in trials),
        refusals=dict(refusals),
        newest=max((t.finished_at for t in trials if t.finished_at), default=None),
    )


def _total(values: Iterable[int | None]) -> Total:
    numbers = [value for value in values if value is not None]
    return Total(known=len(numbers), sum=sum(numbers))
