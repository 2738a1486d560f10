"""Outcomes of runners: checked, scored and stored under their leases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final, Literal, TypeVar

import structlog

from buildarena_api.checking import Checker
from buildarena_api.runners.views import NamedFile, TrialFault, TrialOutcome
from buildarena_backend.artifacts.kinds import EVIDENCE
from buildarena_backend.artifacts.uploads import Uploads
from buildarena_backend.database.text import clean
from buildarena_backend.errors import StaleLeaseError, UploadError
from buildarena_backend.leases.leases import JobToken, Lease
from buildarena_backend.process.context import Context
from buildarena_backend.states import AttemptResult
from buildarena_backend.telemetry.tracing import Attribute, span
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_backend.trials.trial_checks import (
    checked_trajectory,
    checked_versions,
    require_decided,
    require_refusable,
)
from buildarena_backend.trials.trial_repository import DueTrial, TrialRepository
from buildarena_backend.trials.trials import File, TrialResult
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory

T = TypeVar("T")
SPARE_BYTES: Final = 1 << 30
"""Memory for one file: that of the most block-seconds takes some 200 MB while it is read."""
LONGEST_S: Final = 30.0


def check_trial(
    check: Callable[..., T], machine: Mapping[str, Any], scenario: Scenario, more: dict[str, Any]
) -> T:
    """Return the findings of a trial's check, `checked_trajectory` or `require_refusable`.

    Args:
        machine: The document of the machine that was tried.

    Raises:
        UploadError: It refuses.
    """
    return check(machine=Machine.from_document(machine), scenario=scenario, **more)


@cache
def shared_checker() -> Checker[Any]:
    """Return this process' checker; its child starts with the first file and ends with it."""
    return Checker("trajectories", check_trial, spare_bytes=SPARE_BYTES, longest_s=LONGEST_S)


LONGEST_DETAIL: Final = 2000
MAX_EVIDENCE_BYTES: Final = 16 << 20
"""Bytes of evidence of a job's latest fault; that of earlier ones is removed."""
Status = Literal["done", "already_done"]

log = structlog.get_logger(__name__)


class Outcomes:
    """Ends the leases of runners."""

    def __init__(self, context: Context, uploads: Uploads) -> None:
        self._context = context
        self._trials = TrialRepository(context)
        self._uploads = uploads
        self._checker = shared_checker()

    def complete(self, named: JobToken, prefix: str, report: TrialOutcome) -> Status:
        """Score a trial and move its job on.

        Raises:
            StaleLeaseError: The lease is over.
            UploadError: It is not an outcome of its trial.
        """

        def end(lease: Lease) -> None:
            due = self._trials.due(lease.job)
            try:
                outcome = self._check_outcome(named, due, report)
            except UploadError as error:
                log.warning("outcome_refused", job=named[0], runner=lease.owner, error=str(error))
                self._uploads.drop(named)
                raise
            attributes: dict[str, Attribute] = {
                "buildarena.job": lease.job.id,
                "buildarena.token": lease.token,
                "buildarena.runner": lease.owner,
                "buildarena.wall_s": outcome.wall_s,
            }
            with span("score", attributes, parent=lease.job.traceparent):
                self._trials.complete(lease, due, outcome)

        return self._end_once(named, prefix, AttemptResult.DONE, end)

    def fault(self, named: JobToken, prefix: str, report: TrialFault) -> Status:
        """Record a failure of the runner or its simulator; see `RunnerLeases.fault`.

        Raises:
            StaleLeaseError: The lease is over.
            UploadError: A file was not uploaded, or is too large.
        """

        def end(lease: Lease) -> None:
            number = self._trials.due(lease.job).request.number
            files = self._files(named, number, report.files)
            size = sum(len(file.data) for file in files.values())
            if size > MAX_EVIDENCE_BYTES:
                raise UploadError(
                    f"what shows a fault has at most {MAX_EVIDENCE_BYTES:,} bytes, these files "
                    f"{size:,}"
                )
            self._trials.store_evidence(lease.job, files)
            detail = str(clean(report.detail))[:LONGEST_DETAIL]
            self._context.store.runner_leases.fault(
                lease, detail, reason=report.reason, permanent=report.permanent
            )

        kind = AttemptResult.PERMANENT_FAULT if report.permanent else AttemptResult.FAULT
        return self._end_once(named, prefix, kind, end)

    def hand_back(self, named: JobToken, prefix: str) -> Status:
        """Give the job back, without fault.

        Raises:
            StaleLeaseError: The lease is over.
        """
        return self._end_once(
            named, prefix, AttemptResult.HANDED_BACK, self._context.store.leases.hand_back
        )

    def _end_once(
        self, named: JobToken, prefix: str, as_: AttemptResult, end: Callable[[Lease], object]
    ) -> Status:
        """End a lease once: a repeated request after a lost answer gets the same status."""
        leases = self._context.store.runner_leases
        try:
            end(leases.live(*named, prefix))
        except StaleLeaseError:
            if leases.ending(*named, prefix) == as_:
                return "already_done"
            raise
        self._uploads.drop(named)
        return "done"

    def _check_outcome(self, named: JobToken, due: DueTrial, report: TrialOutcome) -> TrialResult:
        simulator, version = due.request.engine, due.version
        if report.annotations is not None and simulator != BESIEGE:
            raise UploadError("only trials in the game have annotations")
        trajectory: Trajectory | None = None
        files = self._files(named, due.request.number, report.files)
        if report.trajectory is None:
            log_file = files.get(f"log-{due.request.number}.txt")
            self._check(
                require_refusable,
                due,
                simulator=simulator,
                versions=report.versions,
                log=None if log_file is None else log_file.data,
            )
        else:
            trajectory = self._check(
                checked_trajectory,
                due,
                data=self._uploads.take(named, report.trajectory),
                simulator=simulator,
                version=version,
                seed=due.request.seed,
            )
            if simulator != BESIEGE:
                require_decided(trajectory, due.task, seed=due.request.seed)
        annotations = report.annotations
        return TrialResult(
            trajectory=trajectory,
            versions=checked_versions(
                report.versions, simulator=simulator, version=version, trajectory=trajectory
            ),
            wall_s=report.wall_s,
            files=files,
            annotations=None
            if annotations is None
            else {engine: results.model_dump() for engine, results in annotations.items()},
        )

    def _check(self, check: Callable[..., T], due: DueTrial, **more: Any) -> T:
        more["controls"] = due.controls
        result: T = self._checker.ask(check, due.machine.to_document(), due.task.scenario, more)
        return result

    def _files(self, named: JobToken, number: int, files: Sequence[NamedFile]) -> dict[str, File]:
        """Return the files to store; names contain the rollout, so none replaces another's.

        Raises:
            UploadError: One was not uploaded, or has another rollout's name.
        """
        result = {}
        for file in files:
            stem, _, ending = file.name.rpartition(".")
            if stem.split("-")[1] != str(number) or file.name in result:
                raise UploadError(
                    f"{file.name}: files of this trial are named KIND-{number}.ENDING, each once"
                )
            data = self._uploads.take(named, file.sha256)
            result[file.name] = File(data=data, media_type=EVIDENCE[ending])
        return result


def drop_dead_uploads(context: Context, uploads: Uploads) -> None:
    """Remove what was uploaded under leases that are over."""
    # Listed first: a lease that is over then never lives again.
    listed = uploads.leases()
    dead = listed - context.store.runner_leases.alive(listed)
    for named in dead:
        uploads.drop(named)
    if dead:
        log.info("uploads_dropped", leases=len(dead))
