"""Interface of a simulator for the simulate stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal, Protocol

from buildarena_backend.trials.trials import File, TrialRequest, TrialResult

SimulatorKind = Literal["engine", "game"]

BESIEGE: Final = "besiege"
"""The game Besiege itself, played by a runner on a machine that has it."""


class MachineRefusedError(Exception):
    """The simulator can never run the machine: a failed trial."""


class SimulatorFaultError(Exception):
    """The simulator failed, not the machine: the trial is to be run again.

    Args:
        message: A sentence for people.
        files: Evidence of the fault, such as a screenshot, by name.
        delay_s: Wait before it is run again.
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
        versions: Versions that can change a trajectory, for manifests.
    """

    @property
    def name(self) -> str:
        """The name that jobs give it."""

    @property
    def versions(self) -> Mapping[str, Any]:
        """Versions that can change a trajectory, for manifests."""

    def run(self, trial: TrialRequest) -> TrialResult:
        """Run a trial.

        Raises:
            MachineRefusedError: It cannot run the machine.
            SimulatorFaultError: It failed.
            PermanentError: It never will be able to run this job.
            StaleLeaseError: The lease was lost.
        """

    def close(self) -> None:
        """Release all resources."""
