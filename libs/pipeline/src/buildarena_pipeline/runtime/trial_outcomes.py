"""What comes of a trial, as the simulators' side says it: no score, and no database."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from buildarena_simulation import Trajectory

PARQUET: Final = "application/vnd.apache.parquet"


@dataclass(frozen=True, slots=True, kw_only=True)
class File:
    """Bytes to be kept with a job."""

    data: bytes
    media_type: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialOutcome:
    """A trial that was run, or that could not be because of the machine.

    Attributes:
        trajectory: What the scorer reads; None when the simulator refused the machine.
        versions: Everything about the simulator that can change the trajectory.
        wall_s: How long it took, seconds.
        files: Further bytes to keep with the job, by name.
        annotations: What our engines say of the same machine, by engine; never part of the score.
    """

    trajectory: Trajectory | None
    versions: Mapping[str, Any]
    wall_s: float
    files: Mapping[str, File] = field(default_factory=dict)
    annotations: Mapping[str, Any] | None = None
