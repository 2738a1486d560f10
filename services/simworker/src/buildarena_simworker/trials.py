"""Running one trial: the simulators' side of the simulate stage, wherever trials come from."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Protocol

from buildarena_backend.errors import TransientError
from buildarena_backend.trials.simulator import MachineRefusedError, Simulator, SimulatorFaultError
from buildarena_backend.trials.trials import File, TrialRequest, TrialResult, refused


class TrialSource(Protocol):
    """A leased trial: its source and the destination of its outcome.

    Workers with database access have one implementation, those that reach only the API another.
    """

    def take(self) -> TrialRequest | None:
        """Return the trial to run; None if an earlier one with the same input had its result.

        Raises:
            PermanentError: The job is impossible.
        """

    def complete(self, outcome: TrialResult) -> None:
        """Transfer the outcome for scoring.

        Raises:
            StaleLeaseError: Another worker has the job; nothing was written.
        """

    def store_evidence(self, files: dict[str, File]) -> None:
        """Store evidence of a fault with the job."""


def do_trial(simulator: Simulator, leased: TrialSource) -> None:
    """Take, run and transfer a trial; store evidence of a fault before reporting it.

    A machine that the simulator refuses is an outcome too.

    Raises:
        TransientError: The simulator failed; the trial must run again.
        PermanentError: The job is impossible.
        StaleLeaseError: Another worker has the job.
    """
    trial = leased.take()
    if trial is None:
        return
    started = time.perf_counter()
    try:
        outcome = simulator.run(trial)
    except MachineRefusedError as refusal:
        versions = {**simulator.versions, **refused(refusal)}
        outcome = TrialResult(trajectory=None, versions=versions)
    except SimulatorFaultError as fault:
        leased.store_evidence(fault.files)
        raise TransientError(
            str(fault), reason="simulator_fault", delay_s=fault.delay_s, endless=fault.endless
        ) from fault
    leased.complete(replace(outcome, wall_s=time.perf_counter() - started))
