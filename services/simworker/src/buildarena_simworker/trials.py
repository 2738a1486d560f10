"""Running one trial: the simulators' side of the simulate stage, wherever trials come from."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Protocol

from buildarena_backend.errors import TransientError
from buildarena_backend.trials.simulator import (
    MachineRefusedError,
    Simulator,
    SimulatorFaultError,
    TrialRequest,
)
from buildarena_backend.trials.trials import File, TrialResult, refused


class TrialSource(Protocol):
    """A leased trial: where it comes from and where its outcome goes.

    Workers beside the database have one implementation, those that reach only the API another.
    """

    def take(self) -> TrialRequest | None:
        """What is to be run; None when an earlier trial with the same input has the outcome.

        Raises:
            PermanentError: The job can't be done.
        """

    def complete(self, outcome: TrialResult) -> None:
        """Hands the outcome over, to be scored.

        Raises:
            StaleLeaseError: Another worker has the job; nothing was written.
        """

    def keep_evidence(self, files: dict[str, File]) -> None:
        """Keeps what shows a fault with the job."""


def run_trial(simulator: Simulator, trial: TrialRequest) -> TrialResult:
    """Runs a trial to its outcome; a machine that the simulator refuses is an outcome too.

    Raises:
        SimulatorFaultError: The simulator failed.
        PermanentError: It never will be able to run this job.
        StaleLeaseError: Another worker has the job.
    """
    started = time.perf_counter()
    try:
        result = simulator.run(trial)
    except MachineRefusedError as refusal:
        result = TrialResult(
            trajectory=None,
            versions={**simulator.versions, **refused(refusal)},
        )
    return replace(result, wall_s=time.perf_counter() - started)


def do_trial(simulator: Simulator, leased: TrialSource) -> None:
    """Takes, runs and hands over a trial; evidence of a fault is stored before it is reported.

    Raises:
        TransientError: The simulator failed; the trial is to be run again.
        PermanentError: The job can't be done.
        StaleLeaseError: Another worker has the job.
    """
    trial = leased.take()
    if trial is None:
        return
    try:
        outcome = run_trial(simulator, trial)
    except SimulatorFaultError as fault:
        leased.keep_evidence(fault.files)
        raise TransientError(
            str(fault), reason="simulator_fault", delay_s=fault.delay_s, endless=fault.endless
        ) from fault
    leased.complete(outcome)
