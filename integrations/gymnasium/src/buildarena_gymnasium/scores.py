"""Scores in `info`."""

from __future__ import annotations

from typing import Any

from buildarena_benchmark.environment import Trial


def score_told(trial: Trial) -> dict[str, Any]:
    """The score in types that vector environments stack; metrics without a value are left out."""
    metrics = {
        name: value if isinstance(value, str) else float(value)
        for name, value in trial.score.metrics.items()
        if value is not None
    }
    return {
        "success": trial.score.success,
        "indicator": float(trial.score.indicator),
        "metrics": metrics,
        "flags": list(trial.score.flags),
        "reason": trial.reason or "",
    }
