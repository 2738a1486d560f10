"""Estimates of a sweep's cost, from the token figures that the paper reports per task."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, Final

from buildarena_backend.catalog.models import BUILTIN_PROTOCOL, ModelRegistry
from buildarena_backend.catalog.prices import price_usd
from buildarena_backend.catalog.tracks import session_limits
from buildarena_backend.jobs.job import NewJobs
from buildarena_benchmark.statistics import board_power

FIGURES: Final = ("requests", "input_tokens", "output_tokens")
"""Mean use of one job."""


def estimate(jobs: Sequence[NewJobs], registry: ModelRegistry) -> Mapping[str, Any]:
    """Add up the mean figures of each job's task; built-in models cost nothing.

    Source: the paper's cost tables; the mean over its twelve models per task, and over all tasks
    for a task of one's own.

    Returns:
        The ``jobs``; the ``models`` with the use of each, its cost None when no price is known; the
        whole ``cost_usd``; ``max_cost_usd``, which the jobs' limits leave; and ``power``, what the
        figures could show.
    """
    by_model: dict[str, list[NewJobs]] = {}
    for some in jobs:
        by_model.setdefault(some.model, []).append(some)
    models = [_model(name, new_jobs, registry) for name, new_jobs in by_model.items()]
    return {
        "jobs": sum(model["jobs"] for model in models),
        "models": models,
        "cost_usd": round(sum(model["usage"]["cost_usd"] or 0.0 for model in models), 2),
        "max_cost_usd": sum(
            len(some.seeds)
            * float(session_limits(some.track_config, some.limits).get("max_cost_usd", math.inf))
            for some in jobs
            if registry.provider_of(registry.models[some.model]).protocol != BUILTIN_PROTOCOL
        ),
        "power": board_power(
            models=len(by_model),
            tasks=len({some.task for some in jobs}),
            trials=min(len(some.seeds) for some in jobs),
        ),
    }


def _model(name: str, jobs: Sequence[NewJobs], registry: ModelRegistry) -> dict[str, Any]:
    entry = registry.models[name]
    usage: dict[str, float | None] = {"cost_usd": 0.0, **dict.fromkeys(FIGURES, 0)}
    if registry.provider_of(entry).protocol != BUILTIN_PROTOCOL:
        used = {
            figure: round(sum(_mean_use(some.task)[figure] * len(some.seeds) for some in jobs))
            for figure in FIGURES
        }
        read, written = used["input_tokens"], used["output_tokens"]
        cost = price_usd(entry, read, written)
        usage = {**used, "cost_usd": float(cost) if cost else None}
    return {"model": name, "jobs": sum(len(some.seeds) for some in jobs), "usage": usage}


def _mean_use(task: str) -> Mapping[str, float]:
    table = _table()
    return table.get(task) or table[""]


@cache
def _table() -> Mapping[str, Mapping[str, float]]:
    """Mean figures by task name; under the empty name those over all tasks."""
    text = resources.files(__package__).joinpath("published_costs.csv").read_text()
    return {
        row["task"]: {figure: float(row[figure]) for figure in FIGURES}
        for row in csv.DictReader(text.splitlines())
    }
