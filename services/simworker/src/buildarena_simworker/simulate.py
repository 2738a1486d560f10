"""Simulate stage of a worker with database access."""

from __future__ import annotations

from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_backend.process.context import Context
from buildarena_backend.trials.simulator import Simulator
from buildarena_backend.trials.trial_repository import DueTrial, TrialRepository
from buildarena_backend.trials.trials import File, TrialRequest, TrialResult
from buildarena_simworker.trials import do_trial


class SimulateHandler:
    """Simulation of the waiting trials of jobs; each job then ends, or returns to its session.

    Args:
        context: The process' connections.
    """

    def __init__(self, context: Context, simulator: Simulator) -> None:
        self._trials = TrialRepository(context)
        self._simulator = simulator

    def __call__(self, active: ActiveLease) -> None:
        """Simulate the leased job's waiting trial; see `StageHandler`."""
        do_trial(self._simulator, _LeasedInDatabase(self._trials, active))


class _LeasedInDatabase:
    """A `TrialSource` of this process' own lease."""

    def __init__(self, trials: TrialRepository, active: ActiveLease) -> None:
        self._trials = trials
        self._active = active
        self._due: DueTrial | None = None

    def take(self) -> TrialRequest | None:
        lease = self._active.lease
        due = self._due = self._trials.due(lease.job)
        if self._trials.repeat(lease, due):
            return None
        return TrialRequest(
            job_id=lease.job.id,
            number=due.request.number,
            token=lease.token,
            version=due.version,
            task=due.task,
            machine=due.machine,
            controls=due.controls,
            seed=due.request.seed,
            require_held=self._require,
        )

    def complete(self, outcome: TrialResult) -> None:
        assert self._due is not None, "a trial is taken before it is completed"  # noqa: S101
        self._trials.complete(self._active.lease, self._due, outcome)

    def store_evidence(self, files: dict[str, File]) -> None:
        self._trials.store_evidence(self._active.lease.job, files)

    def _require(self) -> None:
        if self._active.lost:
            raise StaleLeaseError(self._active.lease.job.id, self._active.lease.token)
