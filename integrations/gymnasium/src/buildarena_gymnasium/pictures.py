"""What is told of an episode: pictures of what it built or drives, and scores of its trials."""

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


Picture = NDArray[np.uint8]
"""(height, width, 3), red, green and blue."""


def checked_mode(mode: str | None, modes: Sequence[str]) -> str | None:
    """A render mode, if there is such a one; None for none.

    Raises:
        ValueError: There is not; the message has those that there are.
    """
    if mode is not None and mode not in modes:
        raise ValueError(f"there is no render mode {mode!r}: choose from {modes}")
    return mode


def picture_of(environment: Environment) -> Picture:
    """The machine that would be submitted, as its trial starts it; white where there is none."""
    try:
        png = still_png(environment.submitted(), environment.task.scenario)
    except (NothingToSubmitError, MachineNotSimulable):
        return np.full((SIZE[1], SIZE[0], 3), 255, dtype=np.uint8)
    return _read(png)


def picture_at(machine: Machine, scenario: Scenario, trajectory: Trajectory) -> Picture:
    """A machine and what is around it at the last instant of a trajectory."""
    return _read(still_png(machine, scenario, trajectory))


def _read(png: bytes) -> Picture:
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB"), dtype=np.uint8)
