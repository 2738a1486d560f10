"""What a simulator is to the simulate stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, Protocol

from buildarena_benchmark import Task
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.runtime.trial_outcomes import File
from buildarena_simulation import Trajectory

__all__ = [
    "BESIEGE",
    "File",
    "MachineRefusedError",
    "Simulated",
    "Simulator",
    "SimulatorFaultError",
    "SimulatorKind",
    "Trial",
]

SimulatorKind = Literal["engine", "game"]

BESIEGE: Final = "besiege"
"""The game Besiege itself, played by a runner on a machine that has it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One machine to be run.

    Attributes:
        job_id: The job it belongs to.
        number: Which of the job's rollouts it is.
        token: Of the lease under which it runs; no other run of the job has it.
        version: The simulator's version that the job was submitted for.
        task: What the machine is put through.
        machine: The machine.
        controls: Key presses of this run; None for the machine's own.
        require_held: Raises `StaleLeaseError` once the job is somebody else's.
    """

    job_id: str
    number: int
    token: int
    version: str
    task: Task
    machine: Machine
    controls: Sequence[KeyPress] | None
    require_held: Callable[[], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """What came of a trial.

    Attributes:
        trajectory: What the scorer reads.
        versions: Everything about the simulator that can change the trajectory.
        files: Further bytes to keep with the job, by name.
        annotations: What our engines say of the same machine, by engine; never part of the score.
    """

    trajectory: Trajectory
    versions: Mapping[str, Any]
    files: Mapping[str, File] = field(default_factory=dict)
    annotations: Mapping[str, Any] | None = None


class MachineRefusedError(Exception):
    """The simulator cannot run the machine, whoever asks and however often: a failed trial."""


class SimulatorFaultError(Exception):
    """The simulator failed, not the machine: the trial is to be run again.

    Args:
        message: A sentence for people.
        files: What shows the fault, such as a screenshot, by name.
        delay_s: How long to wait before it is run again.
        endless: Whether it waits for a person and so never counts against the job.
    """

    def __init__(
        self,
        message: str,
        *,
        files: Mapping[str, File] | None = None,
        delay_s: float = 2.0,
        endless: bool = False,
    ) -> None:
        super().__init__(message)
        self.files = dict(files or {})
        self.delay_s = delay_s
        self.endless = endless


class Simulator(Protocol):
    """Runs trials, one at a time.

    Attributes:
        name: The name that jobs give it.
        versions: What can change a trajectory, for manifests.
        repeatable: Whether the same input gives the same bytes.
    """

    @property
    def name(self) -> str:
        """The name that jobs give it."""

    @property
    def versions(self) -> Mapping[str, Any]:
        """What can change a trajectory, for manifests."""

    @property
    def repeatable(self) -> bool:
        """Whether the same input gives the same bytes."""

    def run(self, trial: Trial) -> Simulated:
        """Runs a trial.

        Raises:
            MachineRefusedError: It cannot run the machine.
            SimulatorFaultError: It failed.
            PermanentError: It never will be able to run this job.
            StaleLeaseError: The job is somebody else's by now.
        """

    def close(self) -> None:
        """Lets go of whatever it holds."""
