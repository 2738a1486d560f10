"""The simulate stage of a worker beside the database."""

from __future__ import annotations

from buildarena_pipeline.runtime.active_lease import ActiveLease
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.trial_books import DueTrial, TrialBooks
from buildarena_pipeline.runtime.trial_outcomes import File, TrialOutcome
from buildarena_simworker.simulators.simulator import Simulator, Trial
from buildarena_simworker.trials import do_trial
from buildarena_store import StaleLeaseError


class SimulateHandler:
    """Simulates the waiting rollouts of jobs; each job then ends, or goes back to its session.

    Args:
        books: Where trials come from and outcomes go.
        simulator: What runs them.
    """

    def __init__(self, books: TrialBooks, simulator: Simulator) -> None:
        self._books = books
        self._simulator = simulator

    def __call__(self, active: ActiveLease) -> None:
        """Simulates the leased job's waiting rollout; see `StageHandler`."""
        leased = _LeasedInDatabase(self._books, active, repeatable=self._simulator.repeatable)
        do_trial(self._simulator, leased)


class _LeasedInDatabase:
    """A `LeasedTrial` of this process' own lease."""

    def __init__(self, books: TrialBooks, active: ActiveLease, *, repeatable: bool) -> None:
        self._books = books
        self._active = active
        self._repeatable = repeatable
        self._due: DueTrial | None = None

    def take(self) -> Trial | None:
        lease = self._active.lease
        due = self._due = self._books.due(lease.job)
        if self._repeatable and self._books.repeat(lease, due):
            return None
        return Trial(
            job_id=lease.job.id,
            number=due.request.number,
            token=lease.token,
            version=due.version,
            task=due.task,
            machine=due.machine,
            controls=due.controls,
            require_held=self._require,
        )

    def complete(self, outcome: TrialOutcome) -> None:
        assert self._due is not None, "a trial is taken before it is completed"  # noqa: S101
        self._books.complete(self._active.lease, self._due, outcome)

    def keep_evidence(self, files: dict[str, File]) -> None:
        self._books.keep_evidence(self._active.lease.job.id, files)

    def _require(self) -> None:
        if self._active.lost:
            raise StaleLeaseError(self._active.lease.job.id, self._active.lease.token)


def simulate_handler(context: Context, simulator: Simulator) -> SimulateHandler:
    """What does the simulate stage, from a process' connections."""
    return SimulateHandler(TrialBooks.of(context), simulator)
