"""The ranking over several tasks, with difficulty dimensions and the cost front."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.leaderboard.cells import Cell
from buildarena_benchmark.leaderboard.standings import Standing
from buildarena_benchmark.statistics import mean_ranks

Weights = Mapping[str, Mapping[str, int]]
"""Weight of each difficulty dimension, by task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OverallRow:
    """One model configuration over the board's tasks.

    Only a configuration with counted trials on every task of the board is ranked; the others
    are shown with what they lack.

    Attributes:
        rank: Shared rank, or None.
        rank_low: Lower end of the 95 % interval of the place, or None.
        rank_high: Upper end, or None.
        mean_rank: Mean rank over tasks and both figures, or None.
        missing: Tasks of the board without counted trials.
        score_mean: Mean of the tasks' scores beside the expert's; None where a task or its expert
            is missing.
        trials: Counted trials on all tasks.
        success_rate_mean: Mean of the tasks' success rates; None without any.
        cost_usd_mean: Mean of the tasks' mean costs.
        output_tokens_mean: Mean of the tasks' mean output tokens.
        pareto: Whether it succeeded at all and no other ranked configuration is both better and
            cheaper.
        dimensions: Score from 0 to 1 by difficulty dimension; empty when it is not ranked.
    """

    model: str
    configuration: str
    rank: int | None
    rank_low: int | None
    rank_high: int | None
    mean_rank: float | None
    missing: Sequence[str]
    score_mean: float | None
    trials: int
    success_rate_mean: float | None
    cost_usd_mean: float | None
    output_tokens_mean: float | None
    pareto: bool
    dimensions: Mapping[str, float]


def overall_rows(
    cells: Mapping[str, Mapping[str, Cell]], standing: Standing | None, weights: Weights
) -> list[OverallRow]:
    """Configurations over tasks, the best first, unranked ones last.

    Args:
        cells: Cells by task and configuration.
        standing: The ranks of the complete ones; None when none is complete.
        weights: Difficulty weights of the tasks that have some.
    """
    tasks = [task for task, row in cells.items() if any(cell.trials for cell in row.values())]
    names = sorted({name for row in cells.values() for name in row})
    complete, dimensions = list(standing.names) if standing else [], None
    if standing:
        table = [[cells[task][name] for name in complete] for task in tasks]
        dimensions = dimension_scores(table, [weights.get(task, {}) for task in tasks])
    rows = []
    for name in names:
        own = [cells[task][name] for task in cells if name in cells[task]]
        place = complete.index(name) if name in complete else None
        ranked = standing.ranking if standing and place is not None else None
        rows.append(
            OverallRow(
                model=own[0].model,
                configuration=name,
                rank=int(ranked.rank[place]) if ranked else None,
                rank_low=int(ranked.low[place]) if ranked else None,
                rank_high=int(ranked.high[place]) if ranked else None,
                mean_rank=float(ranked.mean_rank[place]) if ranked else None,
                missing=[task for task in tasks if not _counts(cells[task].get(name))],
                score_mean=_mean_of_all([cells[task].get(name) for task in tasks]),
                trials=sum(cell.trials for cell in own),
                success_rate_mean=_mean([cell.success_rate for cell in own]),
                cost_usd_mean=_mean([cell.cost_usd_mean for cell in own]),
                output_tokens_mean=_mean([cell.output_tokens_mean for cell in own]),
                pareto=False,
                dimensions=dimensions[place] if dimensions and place is not None else {},
            )
        )
    rows = [_with_pareto(row, rows) for row in rows]
    return sorted(rows, key=_order)


def dimension_scores(
    table: Sequence[Sequence[Cell]], weights: Sequence[Mapping[str, int]]
) -> list[dict[str, float]]:
    """Scores of configurations along the difficulty dimensions.

    On each task a configuration scores (M - r) / (M - 1) for its mean rank r of M, so 1 for the
    best in everything and 0 for the worst; a dimension's score is the mean over tasks, weighted
    by how much the task asks of it. A single configuration has none to be compared with and
    scores 1.

    Args:
        table: M cells for each of T tasks.
        weights: Weights by dimension for each task; tasks without weights are left out.

    Source:
        Caption and text on the radar figure of the BuildArena paper; weights: the task files.
    """
    models = len(table[0])
    scores = np.ones((len(table), models))
    for number, row in enumerate(table):
        if models > 1:
            scores[number] = (models - _single_task_ranks(row)) / (models - 1)
    names = dict.fromkeys(name for task in weights for name in task)
    by_model: list[dict[str, float]] = [{} for _ in range(models)]
    for name in names:
        weight = np.array([task.get(name, 0) for task in weights], float)
        for model in range(models):
            by_model[model][name] = float(weight @ scores[:, model] / weight.sum())
    return by_model


def _single_task_ranks(row: Sequence[Cell]) -> NDArray[np.float64]:
    success = np.array([[cell.success_rate or 0.0 for cell in row]])
    indicator = np.array([[cell.indicator_mean or 0.0 for cell in row]])
    return mean_ranks(success, indicator)


def _counts(cell: Cell | None) -> bool:
    return cell is not None and cell.trials > 0


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known else None


def _mean_of_all(row: Sequence[Cell | None]) -> float | None:
    """The mean score of a configuration that has one on each task."""
    scores = [None if cell is None else cell.score for cell in row]
    return None if None in scores else _mean(scores)


def _with_pareto(row: OverallRow, rows: Sequence[OverallRow]) -> OverallRow:
    if row.mean_rank is None or row.cost_usd_mean is None or not row.success_rate_mean:
        return row
    beaten = any(
        other.mean_rank <= row.mean_rank
        and other.cost_usd_mean <= row.cost_usd_mean
        and (other.mean_rank, other.cost_usd_mean) != (row.mean_rank, row.cost_usd_mean)
        for other in rows
        if other.mean_rank is not None and other.cost_usd_mean is not None
    )
    return replace(row, pareto=not beaten)


def _order(row: OverallRow) -> tuple[bool, float, float, float, str, str]:
    return (
        row.rank is None,
        row.rank or 0,
        row.mean_rank or 0.0,
        -(row.success_rate_mean or 0.0),
        row.model,
        row.configuration,
    )
