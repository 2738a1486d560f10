"""What a sweep will cost, about: from the token figures that the paper reports per task."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from importlib import resources

from buildarena_backend.catalog.models import BUILTIN_PROTOCOL, ModelRegistry
from buildarena_backend.catalog.prices import price_usd
from buildarena_backend.jobs.job import NewJobs
from buildarena_benchmark.statistics import BoardPower, board_power


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Mean use of one job."""

    requests: float = 0.0
    input_tokens: float = 0.0
    output_tokens: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatedUsage:
    """What jobs would use; the cost is None when no price is known."""

    requests: int
    input_tokens: int
    output_tokens: int
    cost_usd: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimate:
    """What one model's part of a sweep would use."""

    model: str
    jobs: int
    usage: EstimatedUsage


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepEstimate:
    """What a sweep would use, and what its figures could show."""

    jobs: int
    models: Sequence[ModelEstimate]
    cost_usd: float
    power: BoardPower


def estimate(jobs: Sequence[NewJobs], registry: ModelRegistry) -> SweepEstimate:
    """Adds up the mean figures of each job's task; built-in models cost nothing.

    Source: the paper's cost tables; the mean over its twelve models per task, and over all tasks
    for a task of one's own.
    """
    by_model: dict[str, list[NewJobs]] = {}
    for some in jobs:
        by_model.setdefault(some.model, []).append(some)
    models = [_model(name, found, registry) for name, found in by_model.items()]
    total = sum(model.usage.cost_usd or 0.0 for model in models)
    power = board_power(
        models=len(by_model),
        tasks=len({some.task for some in jobs}),
        trials=min(len(some.seeds) for some in jobs),
    )
    number = sum(model.jobs for model in models)
    return SweepEstimate(jobs=number, models=models, cost_usd=round(total, 2), power=power)


def _model(name: str, jobs: Sequence[NewJobs], registry: ModelRegistry) -> ModelEstimate:
    entry = registry.models[name]
    builtin = registry.provider_of(entry).protocol == BUILTIN_PROTOCOL
    figures = [(Figures() if builtin else _figures(some.task), len(some.seeds)) for some in jobs]
    used_in = round(sum(f.input_tokens * number for f, number in figures))
    used_out = round(sum(f.output_tokens * number for f, number in figures))
    cost: Decimal | None = Decimal()
    if not builtin:
        cost = price_usd(entry, input_tokens=used_in, output_tokens=used_out, cached_tokens=0)
        cost = cost or None
    return ModelEstimate(
        model=name,
        jobs=sum(number for _, number in figures),
        usage=EstimatedUsage(
            requests=round(sum(f.requests * number for f, number in figures)),
            input_tokens=used_in,
            output_tokens=used_out,
            cost_usd=None if cost is None else float(cost),
        ),
    )


def _figures(task: str) -> Figures:
    table = _table()
    return table.get(task) or table[""]


@cache
def _table() -> dict[str, Figures]:
    """Mean figures by task name; under the empty name those over all tasks."""
    text = resources.files(__package__).joinpath("published_costs.csv").read_text()
    return {
        row["task"]: Figures(
            requests=float(row["requests"]),
            input_tokens=float(row["input_tokens"]),
            output_tokens=float(row["output_tokens"]),
        )
        for row in csv.DictReader(text.splitlines())
    }
