"""The ranking over several tasks, with the cost front."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict

from buildarena_benchmark.leaderboard.cells import Cell
from buildarena_benchmark.leaderboard.standings import Standing
from buildarena_benchmark.statistics import mean_rate_interval


class OverallRow(BaseModel):
    """A model configuration over the built-in tasks of the board, or over those of the filter."""

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)

    rank: int | None
    """null for a baseline, and where no path of shared tasks leads to the ranked models."""
    rank_low: int | None
    rank_high: int | None
    mean_rank: float | None
    """Over tasks, by success rate and by indicator."""
    model: str
    configuration: str
    label: str
    """The model, with the settings that differ where it has several configurations."""
    baseline: bool
    """A built-in model for comparison."""
    missing: list[str]
    """Tasks of the board without a counted job."""
    score_mean: float | None
    """Mean of its tasks' scores; null where one has no expert."""
    counted: int
    success_rate_mean: float | None
    success_low: float | None
    """Exact 95 % interval of the mean, as wide as with the fewest runs of any task on each."""
    success_high: float | None
    cost_usd_mean: float | None
    output_tokens_mean: float | None
    pareto: bool
    """No other model is both better and cheaper."""


def label_rows(cells: Iterable[Cell]) -> dict[str, str]:
    """Return what each configuration is called: its model, and what differs if it has several."""
    models: dict[str, dict[str, dict[str, Any]]] = {}
    for cell in cells:
        settings = {**cell.decoding, **cell.decoding.get("limits", {})}
        settings.pop("limits", None)
        models.setdefault(cell.model, {})[cell.configuration] = settings
    labels = {}
    for model, own in models.items():
        differing = [
            name
            for name in sorted({name for settings in own.values() for name in settings})
            if len({str(settings.get(name)) for settings in own.values()}) > 1
        ]
        for configuration, settings in own.items():
            parts = [_describe(name, settings[name]) for name in differing if name in settings]
            details = ", ".join(parts) or ("default" if differing else configuration[:8])
            labels[configuration] = f"{model} ({details})" if len(own) > 1 else model
    return labels


def _describe(name: str, value: object) -> str:
    if name == "max_cost_usd":
        return f"at most ${value}"
    label = name.replace("_", " ")
    return f"at most {value} {label[4:]}" if label.startswith("max ") else f"{label} {value}"


def overall_rows(
    cells: Mapping[str, Mapping[str, Cell]], standing: Standing | None, labels: Mapping[str, str]
) -> list[OverallRow]:
    """Return configurations over tasks, the best first, unranked ones last.

    Args:
        cells: Cells by task and configuration.
        standing: Ranks of the ranked rows; None without any.
        labels: See `label_rows`.
    """
    tasks = [task for task, row in cells.items() if any(cell.counted for cell in row.values())]
    names = sorted({name for row in cells.values() for name in row})
    places = standing.places if standing else {}
    rows = []
    for name in names:
        own = [cells[task][name] for task in cells if name in cells[task]]
        scores = [cell.score for cell in own if cell.counted]
        rates = [(c.success_rate, c.counted) for c in own if c.success_rate is not None]
        success = mean_rate_interval(rates) if rates else (None, None)
        rank, high, mean_rank = places.get(name, (None, None, None))
        rows.append(
            OverallRow(
                model=own[0].model,
                configuration=name,
                label=labels[name],
                rank=rank,
                rank_low=rank,
                rank_high=high,
                mean_rank=mean_rank,
                missing=[t for t in tasks if name not in cells[t] or not cells[t][name].counted],
                score_mean=None if None in scores else _mean(scores),
                counted=sum(cell.counted for cell in own),
                success_rate_mean=_mean([rate for rate, _ in rates]),
                success_low=success[0],
                success_high=success[1],
                cost_usd_mean=_mean([cell.cost_usd_mean for cell in own]),
                output_tokens_mean=_mean([cell.output_tokens_mean for cell in own]),
                pareto=False,
                baseline=False,
            )
        )
    rows = [_with_pareto(row, rows) for row in rows]
    return sorted(rows, key=_order)


def _mean(values: Sequence[float | None]) -> float | None:
    numbers = [value for value in values if value is not None]
    return math.fsum(numbers) / len(numbers) if numbers else None


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
    return row.model_copy(update={"pareto": not beaten})


def _order(row: OverallRow) -> tuple[bool, float, float, float, str, str]:
    return (
        row.rank is None,
        row.rank or 0,
        row.mean_rank or 0.0,
        -(row.success_rate_mean or 0.0),
        row.model,
        row.configuration,
    )
