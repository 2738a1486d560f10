"""Requests and results of trials, as simulators use them: without scores and database."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from buildarena_benchmark import Task
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Trajectory

PARQUET: Final = "application/vnd.apache.parquet"
REFUSED: Final = "refused"
"""Key in a trial's versions for the reason why the machine was not simulated to the end."""
MAX_SENTENCE: Final = 400
"""Its length, characters."""
FaultReason = Literal[
    "simulator_fault",
    "game_version",
    "unreadable_trial",
    "outcome_refused",
    "internal_error",
]
"""Reasons for a trial that a runner did not complete."""


@dataclass(frozen=True, slots=True, kw_only=True)
class File:
    """Bytes to be stored with a job."""

    data: bytes
    media_type: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRequest:
    """A machine to be run.

    Attributes:
        token: Token of its lease; no other run of the job has it.
        version: The simulator's version that the job was submitted for.
        controls: Key presses of this run; None for the machine's own.
        seed: Seed of the varied world; None for the exact one.
        require_held: Raises `StaleLeaseError` once the lease is lost.
    """

    job_id: str
    number: int
    token: int
    version: str
    task: Task
    machine: Machine
    controls: Sequence[KeyPress] | None
    require_held: Callable[[], None]
    seed: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """Result of a trial.

    Attributes:
        trajectory: None when the simulator refused the machine, or the machine's program failed.
        versions: Everything about the simulator that can change the trajectory.
        wall_s: Duration, measured by the process that runs the simulator.
        files: Further bytes to store with the job, by name.
        annotations: Results of our engines for the machine, by engine; never part of the score.
    """

    trajectory: Trajectory | None
    versions: Mapping[str, Any]
    wall_s: float = 0.0
    files: Mapping[str, File] = field(default_factory=dict)
    annotations: Mapping[str, Any] | None = None


def refused(reason: object) -> Mapping[str, str]:
    """Return the entry in a trial's versions for a machine not simulated to the end.

    Args:
        reason: The error, or its sentence; "" where there is none.
    """
    sentence = str(reason)[:MAX_SENTENCE]
    return {REFUSED: sentence} if sentence else {}
