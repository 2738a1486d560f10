"""Cells: all trials of one model configuration on one task, summarised with their uncertainty."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.flags import Reading, is_censored, is_disqualified, is_left_out
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.outcomes import SIMULATED, Outcome
from buildarena_benchmark.statistics import (
    cost_per_success,
    exact_interval,
    mean_interval,
    pass_at_k,
    pass_hat_k,
)

TRIES: Final = (1, 2, 4, 8)
"""The k of pass@k and pass^k."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One model configuration on one task. What does not exist is None.

    Averages are over counted trials: scored ones, as far as the reading of flags leaves them in.

    Attributes:
        trials: Counted trials: the denominator of the averages.
        ended: All ended jobs, errored, cancelled and flagged ones included: the other
            denominator.
        errored: Jobs that infrastructure faults ended.
        cancelled: Jobs that somebody cancelled.
        flagged: Scored trials that a flag makes failures or, in the published reading, leaves out.
        flags: Scored trials by flag; one may have several.
        imported: Jobs that came from another service's archive, unverified ones included.
        unverified: Those of them that were not found again here: they count in nothing else.
        simulated: Counted trials whose machine was finished and tried.
        success_rate: Successes of counted trials, with its exact interval.
        success_rate_of_ended: Successes of all ended jobs.
        indicator_mean: Mean indicator, with its interval.
        too_few_data: Whether too few counted trials succeeded for an interval of the indicator.
        indicator_best: The greatest indicator.
        censored: Counted trials whose indicator is only known to be at least as great; if there
            are any, the mean and the best are at least what they say.
        invalid_action_rate: Refused actions of all actions.
        cost_per_success_usd: US dollars of all counted trials for each success.
        pass_at: Chance that at least one of k tries succeeds, by k.
        pass_all: Chance that all of k tries succeed, by k.
        outcomes: Ended jobs by outcome.
        reasons: Counted trials that failed, by reason.
        refusals: Refused actions by refusal class.
        newest: When the last of its jobs ended.
        figures: (N, 2) float64, success and indicator of each counted trial.
    """

    task: str
    model: str
    configuration: str
    decoding: Mapping[str, Any]
    trials: int
    ended: int
    errored: int
    cancelled: int
    flagged: int
    flags: Mapping[str, int]
    imported: int
    unverified: int
    simulated: int
    successes: int
    success_rate: float | None
    success_low: float | None
    success_high: float | None
    success_rate_of_ended: float | None
    indicator_mean: float | None
    indicator_low: float | None
    indicator_high: float | None
    too_few_data: bool
    indicator_best: float | None
    censored: int
    parts_mean: float | None
    requests_mean: float | None
    input_tokens_mean: float | None
    output_tokens_mean: float | None
    cost_usd_mean: float | None
    cost_per_success_usd: float | None
    invalid_action_rate: float | None
    pass_at: Mapping[str, float]
    pass_all: Mapping[str, float]
    outcomes: Mapping[str, int]
    reasons: Mapping[str, int]
    refusals: Mapping[str, int]
    newest: datetime | None
    figures: NDArray[np.float64] = field(repr=False, compare=False)


def counted_trials(
    trials: Iterable[EndedJob], *, reading: Reading = Reading.OURS
) -> list[EndedJob]:
    """The trials that averages are made of, as a reading of flags has them.

    In ours a disqualified trial stays, as a failure with an indicator of 0: were it left out, a
    model would lose nothing by trying to cheat, and one whose machines blow up would gain.
    """
    counted = []
    for trial in trials:
        if not trial.scored or is_left_out(trial.flags, reading):
            continue
        if reading == Reading.OURS and is_disqualified(trial.flags):
            counted.append(replace(trial, success=False, indicator=0.0))
        else:
            counted.append(trial)
    return counted


def summarise(trials: Sequence[EndedJob], *, reading: Reading = Reading.OURS) -> Cell:
    """Summarises the trials of one model configuration on one task; at least one.

    The order of the trials does not matter.
    """
    first, imported = trials[0], sum(trial.imported for trial in trials)
    given, trials = len(trials), [trial for trial in trials if not trial.unverified]
    counted = counted_trials(trials, reading=reading)
    number = len(counted)
    successes = sum(trial.success for trial in counted)
    outcomes = Counter(trial.outcome for trial in trials)
    low_high = exact_interval(successes, number) if counted else (None, None)
    figures = np.array([(t.success, t.indicator) for t in counted], float).reshape(-1, 2)
    indicator_ends = mean_interval(figures[:, 1], figures[:, 0] > 0) if counted else None
    scored = [trial for trial in trials if trial.scored]
    actions = sum(trial.actions for trial in counted)
    refused = sum(trial.refused_actions for trial in counted)
    mean = _Means(counted)
    return Cell(
        task=first.task,
        model=first.model,
        configuration=first.configuration,
        decoding=first.decoding,
        trials=number,
        ended=len(trials),
        errored=outcomes[Outcome.ERRORED],
        cancelled=outcomes[Outcome.CANCELLED],
        flagged=sum(_is_flagged(trial, reading) for trial in scored),
        flags=dict(sorted(Counter(flag for t in scored for flag in set(t.flags)).items())),
        imported=imported,
        unverified=given - len(trials),
        simulated=sum(trial.outcome in SIMULATED for trial in counted),
        successes=successes,
        success_rate=successes / number if number else None,
        success_low=low_high[0],
        success_high=low_high[1],
        success_rate_of_ended=successes / len(trials) if trials else None,
        indicator_mean=mean.of(lambda t: t.indicator),
        indicator_low=indicator_ends[0] if indicator_ends else None,
        indicator_high=indicator_ends[1] if indicator_ends else None,
        too_few_data=bool(counted) and indicator_ends is None,
        indicator_best=max((t.indicator for t in counted), default=None),
        censored=sum(t.success and is_censored(t.flags) for t in counted),
        parts_mean=mean.of(lambda t: t.parts),
        requests_mean=mean.of(lambda t: t.requests),
        input_tokens_mean=mean.of(lambda t: t.input_tokens),
        output_tokens_mean=mean.of(lambda t: t.output_tokens),
        cost_usd_mean=mean.of(lambda t: t.cost_usd),
        cost_per_success_usd=cost_per_success([t.cost_usd for t in counted], successes),
        invalid_action_rate=refused / actions if actions else None,
        pass_at=_tries(pass_at_k, successes, number),
        pass_all=_tries(pass_hat_k, successes, number),
        outcomes=dict(sorted(outcomes.items())),
        reasons=dict(sorted(Counter(t.reason for t in counted if t.reason).items())),
        refusals=_refusals(counted),
        newest=max((t.finished_at for t in trials if t.finished_at), default=None),
        figures=figures[np.lexsort(figures.T)],
    )


def _is_flagged(trial: EndedJob, reading: Reading) -> bool:
    if reading == Reading.OURS:
        return is_disqualified(trial.flags)
    return is_left_out(trial.flags, reading)


class _Means:
    """Means over the trials that have a value."""

    def __init__(self, trials: Sequence[EndedJob]) -> None:
        self._trials = trials

    def of(self, value: Callable[[EndedJob], float | None]) -> float | None:
        # fsum is exact, so the order of the trials cannot show in the last digit.
        values = [v for v in map(value, self._trials) if v is not None]
        return math.fsum(values) / len(values) if values else None


def _tries(
    estimate: Callable[[int, int, int], float | None], successes: int, trials: int
) -> dict[str, float]:
    found = {str(k): estimate(successes, trials, k) for k in TRIES}
    return {k: chance for k, chance in found.items() if chance is not None}


def _refusals(trials: Iterable[EndedJob]) -> dict[str, int]:
    total: Counter[str] = Counter()
    for trial in trials:
        total.update(trial.refusals)
    return dict(sorted(total.items()))
