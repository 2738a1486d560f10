"""Boards made in the plain way, from all ended jobs one by one: what the kept ones must equal."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark import references
from buildarena_benchmark.flags import ScoringPolicy, is_censored, is_disqualified, is_left_out
from buildarena_benchmark.leaderboard import (
    Board,
    BoardQuery,
    Cell,
    CellHead,
    CellKey,
    EndedJob,
    TestCache,
    choose_cells,
    counted_trials,
    ranked_board,
)
from buildarena_benchmark.leaderboard.cells import PASS_K
from buildarena_benchmark.outcomes import SIMULATED, Outcome
from buildarena_benchmark.statistics import (
    Sample,
    cost_per_success,
    exact_interval,
    mean_interval,
    pass_at_k,
    pass_hat_k,
)


def plain_board(
    trials: Iterable[EndedJob],
    query: BoardQuery,
    versions: Mapping[str, str],
    weights: Mapping[str, Mapping[str, int]],
    *,
    inside: Callable[[EndedJob], bool] = lambda _: True,
) -> Board:
    """The board of a track's trials."""
    cells: dict[CellKey, list[EndedJob]] = {}
    for trial in trials:
        key = (trial.task, trial.task_version, trial.configuration)
        cells.setdefault(key, []).append(trial)
    heads = [
        CellHead(
            key=key,
            model=found[0].model,
            newest=max((t.finished_at for t in found if t.finished_at), default=None),
        )
        for key, found in cells.items()
    ]
    chosen = choose_cells(heads, versions, query)
    held = {key: [t for t in found if query.holds(t) and inside(t)] for key, found in cells.items()}
    return ranked_board(
        chosen,
        lambda key: plain_summary(held[key], policy=query.policy) if held[key] else None,
        {task: sum(len(held[key]) for key in keys) for task, keys in chosen.outdated.items()},
        overall=query.overall,
        weights=weights,
        tests=TestCache(),
    )


def plain_summary(
    trials: Sequence[EndedJob], *, policy: ScoringPolicy = ScoringPolicy.OURS
) -> Cell:
    """The summary of one cell's trials."""
    first = trials[0]
    by_runner = sum(trial.by_runner for trial in trials)
    refuted = sum("refuted" in trial.flags for trial in trials)
    given, trials = len(trials), [trial for trial in trials if not trial.unverified]
    counted = counted_trials(trials, policy=policy)
    number = len(counted)
    successes = math.fsum(trial.share for trial in counted)
    outcomes = Counter(trial.outcome for trial in trials)
    low_high = exact_interval(successes, number) if counted else (None, None)
    figures = np.array([(t.share, t.indicator) for t in counted], float).reshape(-1, 2)
    indicator_ends = mean_interval(figures[:, 1], figures[:, 0] > 0) if counted else None
    score, score_ends = None, None
    if counted and first.task in references():
        scores = np.log2(1 + np.maximum(figures[:, 1], 0) / references()[first.task])
        score = math.fsum(scores.tolist()) / number
        score_ends = mean_interval(scores, figures[:, 0] > 0)
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
        flagged=sum(_is_flagged(trial, policy) for trial in scored),
        flags=dict(sorted(Counter(flag for t in scored for flag in set(t.flags)).items())),
        by_runner=by_runner,
        unverified=given - len(trials),
        refuted=refuted,
        simulated=sum(trial.outcome in SIMULATED for trial in counted),
        successes=successes,
        success_rate=successes / number if number else None,
        success_low=low_high[0],
        success_high=low_high[1],
        success_rate_of_ended=successes / len(trials) if trials else None,
        indicator_mean=mean.of(lambda t: t.indicator),
        indicator_low=indicator_ends[0] if indicator_ends else None,
        indicator_high=indicator_ends[1] if indicator_ends else None,
        score=score,
        score_low=score_ends[0] if score_ends else None,
        score_high=score_ends[1] if score_ends else None,
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
        pass_at=_pass_chances(pass_at_k, figures[:, 0]),
        pass_all=_pass_chances(pass_hat_k, figures[:, 0]),
        outcomes=dict(sorted(outcomes.items())),
        reasons=dict(sorted(Counter(t.reason for t in counted if t.reason).items())),
        refusals=_refusals(counted),
        newest=max((t.finished_at for t in trials if t.finished_at), default=None),
        sample=Sample.of(figures),
        figures_hash=figures[np.lexsort(figures.T)].tobytes(),
    )


def _is_flagged(trial: EndedJob, policy: ScoringPolicy) -> bool:
    if policy == ScoringPolicy.OURS:
        return is_disqualified(trial.flags)
    return is_left_out(trial.flags, policy)


class _Means:
    """Means over the trials that have a value."""

    def __init__(self, trials: Sequence[EndedJob]) -> None:
        self._trials = trials

    def of(self, value: Callable[[EndedJob], float | None]) -> float | None:
        # fsum is exact, so the order of the trials cannot show in the last digit.
        values = [v for v in map(value, self._trials) if v is not None]
        return math.fsum(values) / len(values) if values else None


def _pass_chances(
    estimate: Callable[[NDArray[np.float64], int], float | None], shares: NDArray[np.float64]
) -> dict[str, float]:
    found = {str(k): estimate(shares, k) for k in PASS_K}
    return {k: chance for k, chance in found.items() if chance is not None}


def _refusals(trials: Iterable[EndedJob]) -> dict[str, int]:
    total: Counter[str] = Counter()
    for trial in trials:
        total.update(trial.refusals)
    return dict(sorted(total.items()))
