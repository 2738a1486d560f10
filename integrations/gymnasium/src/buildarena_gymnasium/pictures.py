"""Outputs of an episode: pictures of its machine, and scores of its trials."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from buildarena_benchmark.environment import Environment, NothingToSubmitError, Trial
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, Scenario, Trajectory
from buildarena_simulation.render.still import SIZE, still_png


def score_values(trial: Trial) -> dict[str, Any]:
    """Return the score in types that vector environments stack, without metrics that are None."""
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


Picture = NDArray[np.uint8]
"""(height, width, 3), red, green and blue."""


def check_mode(mode: str | None, modes: Sequence[str]) -> str | None:
    """Return a render mode after checking that it is valid.

    Raises:
        ValueError: The render mode is unknown.
    """
    if mode is not None and mode not in modes:
        raise ValueError(f"unknown render mode {mode!r}; valid render modes: {modes}")
    return mode


def picture_of(environment: Environment) -> Picture:
    """Draw the machine to submit at the start of its trial; white without a machine."""
    try:
        png = still_png(environment.submitted(), environment.task.scenario)
    except (NothingToSubmitError, MachineNotSimulable):
        return np.full((SIZE[1], SIZE[0], 3), 255, dtype=np.uint8)
    return _decode(png)


def picture_at(machine: Machine, scenario: Scenario, trajectory: Trajectory) -> Picture:
    """Draw a machine and its surroundings at the end of a trajectory."""
    return _decode(still_png(machine, scenario, trajectory))


def _decode(png: bytes) -> Picture:
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB"), dtype=np.uint8)
