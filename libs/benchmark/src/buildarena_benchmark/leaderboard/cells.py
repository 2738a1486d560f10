"""Cells: all trials of one model configuration on one task, summarised with their uncertainty."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from hashlib import blake2b
from itertools import chain
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, InstanceOf

from buildarena_benchmark.flags import is_censored, is_disqualified
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.leaderboard.tallies import Tally, Total, tally_jobs, total_of
from buildarena_benchmark.outcomes import SIMULATED, Outcome
from buildarena_benchmark.scoring.flags import REFUTED
from buildarena_benchmark.statistics.means import cost_per_success, expert_scores, mean_interval
from buildarena_benchmark.statistics.permutation import Sample
from buildarena_benchmark.statistics.proportions import exact_interval, pass_at_k, pass_hat_k
from buildarena_benchmark.tasks.loading import references

PASS_K: Final = (1, 2, 4, 8)
"""The k of pass@k and pass^k."""


class CellFigures(BaseModel):
    """Figures of a model configuration on one task. What does not exist is None.

    Averages are over counted trials: scored ones, as far as the scoring policy leaves them in.
    """

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)

    model: str
    configuration: str
    """Hash of model, decoding and limits."""
    decoding: dict[str, Any]
    """Sampling of the replies, and the limits of the sessions, if any."""
    counted: int
    """Jobs that count: the denominator of the averages."""
    ended: int
    """All ended jobs, also errored and cancelled ones."""
    errored: int
    """Jobs that infrastructure faults ended: in no average."""
    cancelled: int
    flagged: int
    """Scored jobs that a flag makes failures."""
    flags: dict[str, int]
    """Scored jobs by flag."""
    ran_on_runner: int
    """Jobs with a trial that a runner ran."""
    unverified: int
    """Jobs that wait for their verification, or were refuted: they count nowhere."""
    refuted: int
    """Jobs whose verification gave other figures."""
    simulated: int
    """Counted jobs whose machine was finished and simulated."""
    successes: float
    """Sum of the shares of worlds in which jobs succeed."""
    success_rate: float | None
    """null when nothing was scored."""
    success_low: float | None
    """Lower end of the 95 % exact interval."""
    success_high: float | None
    """Upper end of the 95 % exact interval."""
    success_rate_of_ended: float | None
    """Successes of all ended jobs."""
    indicator_mean: float | None
    indicator_low: float | None
    """Lower end of the 95 % interval; null when there are too few data."""
    indicator_high: float | None
    score: float | None
    """Mean of the jobs' indicators relative to the built-in expert's, log2(1 + indicator /
    expert's): 0 for nothing, 1 for as much as the expert, 2 for three times as much; independent
    of the other models. null for a task without expert."""
    score_low: float | None
    """Lower end of its 95 % interval."""
    score_high: float | None
    too_few_data: bool
    """Whether too few succeeded for an interval of the mean indicator."""
    indicator_best: float | None
    censored: int
    """Counted jobs that carried everything; if there are any, the mean and the best indicator are
    at least what they say."""
    parts_mean: float | None
    test_trials_mean: float | None
    """Test trials that builders used; null for a task or track without."""
    requests_mean: float | None
    input_tokens_mean: float | None
    output_tokens_mean: float | None
    cost_usd_mean: float | None
    cost_per_success_usd: float | None
    refused_action_rate: float | None
    pass_at: dict[str, float]
    """Chance that one of k tries succeeds, by k."""
    pass_all: dict[str, float]
    """Chance that all of k tries succeed, by k."""
    outcomes: dict[str, int]
    reasons: dict[str, int]
    """Counted jobs that failed, by reason."""
    refusals: dict[str, int]
    """Refused actions by class."""
    last_finished_at: datetime | None
    """Time at which the last of its jobs ended."""


class Cell(CellFigures):
    """A cell with its sample for comparisons."""

    task: str
    sample: InstanceOf[Sample] = Field(exclude=True, repr=False)
    """Success (or its share) and indicator of each counted trial, for tests of pairs."""
    figures_hash: bytes = Field(exclude=True, repr=False)
    """Hash of the same: cells with the same one are the same to all tests of pairs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellName:
    """Name of a cell."""

    task: str
    model: str
    configuration: str
    decoding: Mapping[str, Any]


def summarise(trials: Sequence[EndedJob]) -> Cell:
    """Summarise the trials of one model configuration on one task; at least one.

    The order of the trials does not matter.
    """
    first = trials[0]
    name = CellName(
        task=first.task,
        model=first.model,
        configuration=first.configuration,
        decoding=first.decoding,
    )
    return summarise_tallies(name, tally_jobs(trials))


def summarise_tallies(name: CellName, all_tallies: Sequence[Tally]) -> Cell:
    """Summarise a cell's tallies, whose order does not matter."""
    tallies = [tally for tally in all_tallies if not tally.unverified]
    scored = [tally for tally in tallies if tally.scored]
    counted = counted_tallies(tallies)
    number, ended = _number(counted), _number(tallies)
    successes = _sum(tally.shares for tally in counted)
    outcomes = _counts((tally.outcome, tally.number) for tally in tallies)
    low_high = exact_interval(successes, number) if counted else (None, None)
    figures = _figures(counted)
    score, score_ends = _score(name.task, figures)
    indicator_ends = mean_interval(figures[:, 1], figures[:, 0] > 0) if counted else None
    actions = sum(tally.actions for tally in counted)
    refused = sum(tally.refused_actions for tally in counted)
    costs = _known_costs(counted)
    return Cell(
        task=name.task,
        model=name.model,
        configuration=name.configuration,
        decoding=dict(name.decoding),
        counted=number,
        ended=ended,
        errored=outcomes.get(Outcome.ERRORED, 0),
        cancelled=outcomes.get(Outcome.CANCELLED, 0),
        flagged=_number(tally for tally in scored if is_disqualified(tally.flags)),
        flags=_counts((flag, tally.number) for tally in scored for flag in set(tally.flags)),
        ran_on_runner=_number(tally for tally in all_tallies if tally.ran_on_runner),
        unverified=_number(all_tallies) - ended,
        refuted=_number(tally for tally in all_tallies if REFUTED.name in tally.flags),
        simulated=_number(tally for tally in counted if tally.outcome in SIMULATED),
        successes=successes,
        success_rate=successes / number if number else None,
        success_low=low_high[0],
        success_high=low_high[1],
        success_rate_of_ended=successes / ended if ended else None,
        indicator_mean=_mean(figures[:, 1]),
        indicator_low=indicator_ends[0] if indicator_ends else None,
        indicator_high=indicator_ends[1] if indicator_ends else None,
        score=score,
        score_low=score_ends[0] if score_ends else None,
        score_high=score_ends[1] if score_ends else None,
        too_few_data=bool(counted) and indicator_ends is None,
        indicator_best=float(figures[:, 1].max()) if number else None,
        censored=sum(int((t.shares > 0).sum()) for t in counted if is_censored(t.flags)),
        parts_mean=_mean_total(tally.parts for tally in counted),
        test_trials_mean=_mean_total(tally.test_trials for tally in counted),
        requests_mean=_mean_total(tally.requests for tally in counted),
        input_tokens_mean=_mean_total(tally.input_tokens for tally in counted),
        output_tokens_mean=_mean_total(total_of(tally.output_tokens) for tally in counted),
        cost_usd_mean=_mean(costs),
        cost_per_success_usd=cost_per_success(
            [*costs.tolist(), *[None] * (number - len(costs))], successes
        ),
        refused_action_rate=refused / actions if actions else None,
        pass_at=_pass_chances(pass_at_k, figures[:, 0]),
        pass_all=_pass_chances(pass_hat_k, figures[:, 0]),
        outcomes=outcomes,
        reasons=_counts((tally.reason, tally.number) for tally in counted if tally.reason),
        refusals=_counts(item for tally in counted for item in tally.refusals.items()),
        last_finished_at=max((tally.newest for tally in tallies if tally.newest), default=None),
        sample=Sample.of_sorted(figures),
        figures_hash=blake2b(figures.tobytes(), digest_size=16).digest(),
    )


def counted_tallies(tallies: Iterable[Tally]) -> list[Tally]:
    """Return the tallies that averages are made of.

    A disqualified trial stays, as a failure with an indicator of 0: were it left out, a
    model would lose nothing by trying to cheat, and one whose machines blow up would gain. So does
    every failure: tasks say when a trial succeeds, and what fails has done nothing that counts.
    """
    counted = []
    for tally in tallies:
        if not tally.scored:
            continue
        if is_disqualified(tally.flags):
            nothing = np.zeros(tally.number)
            counted.append(replace(tally, indicators=nothing, shares=nothing))
        else:
            counted.append(tally)
    return counted


def _score(
    task: str, figures: NDArray[np.float64]
) -> tuple[float | None, tuple[float, float] | None]:
    """Return the mean score relative to the expert's indicator, and its interval."""
    reference = references().get(task)
    if reference is None or not len(figures):
        return None, None
    scores = expert_scores(figures[:, 1], reference)
    return _mean(scores), mean_interval(scores, figures[:, 0] > 0)


def _number(tallies: Iterable[Tally]) -> int:
    return sum(tally.number for tally in tallies)


def _counts(items: Iterable[tuple[str, int]]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for name, number in items:
        counts[name] = counts.get(name, 0) + number
    return dict(sorted(counts.items()))


def _figures(counted: Sequence[Tally]) -> NDArray[np.float64]:
    """Return success, or its share, and indicator of each counted trial, sorted by indicator."""
    figures = np.zeros((_number(counted), 2))
    if counted:
        figures[:, 0] = np.concatenate([tally.shares for tally in counted])
        figures[:, 1] = np.concatenate([tally.indicators for tally in counted])
    return figures[np.lexsort(figures.T)]


def _known_costs(counted: Sequence[Tally]) -> NDArray[np.float64]:
    costs = np.concatenate([np.zeros(0), *(tally.costs_usd for tally in counted)])
    known_costs: NDArray[np.float64] = costs[~np.isnan(costs)]
    return known_costs


def _sum(parts: Iterable[NDArray[np.float64]]) -> float:
    """Return the exact sum of shares: whatever their order."""
    return math.fsum(chain.from_iterable(part.tolist() for part in parts))


def _mean(values: NDArray[np.float64]) -> float | None:
    # fsum is exact, so the order of the trials cannot show in the last digit.
    return math.fsum(values.tolist()) / len(values) if len(values) else None


def _mean_total(totals: Iterable[Total]) -> float | None:
    listed = list(totals)
    count = sum(total.known for total in listed)
    return float(sum(total.sum for total in listed)) / count if count else None


def _pass_chances(
    estimate: Callable[[NDArray[np.float64], int], float | None], shares: NDArray[np.float64]
) -> dict[str, float]:
    chances = {str(k): estimate(shares, k) for k in PASS_K}
    return {k: chance for k, chance in chances.items() if chance is not None}
