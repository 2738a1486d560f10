"""Pictures of what an episode has built, and of what drives."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from buildarena_environment import Environment, NothingToSubmitError
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, Scenario, Trajectory
from buildarena_simulation.render.still import SIZE, still_png

Picture = NDArray[np.uint8]
"""(height, width, 3), red, green and blue."""


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
