"""Verifications that messages ask for, done beside the sessions of a construct worker."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from threading import Lock

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_backend.errors import ArtifactStoreError
from buildarena_backend.results.verifications import Verifications
from buildarena_backend.states import Verdict
from buildarena_worker.verification_report import Report, broken_off
from buildarena_worker.verify import Verifier

AT_ONCE = 2
"""Verifications of one process at once, however many wait."""

log = structlog.get_logger(__name__)


class VerificationRunner:
    """Does the verifications that messages speak of, in threads of its own.

    Messages arrive in the threads of sessions: they only wake it, and take no session's place.

    Args:
        verifications: What was asked for.
        verifier: Does them.
    """

    def __init__(self, verifications: Verifications, verifier: Verifier) -> None:
        self._verifications = verifications
        self._verifier = verifier
        self._threads = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="verifying")
        self._lock = Lock()
        self._active = 0
        self._stopping = False

    def wake(self) -> None:
        """Has waiting verifications done, unless as many as may be are being done."""
        with self._lock:
            if self._active < AT_ONCE and not self._stopping:
                self._active += 1
                self._threads.submit(self._do_next)

    def stop(self) -> None:
        """Begins no further verification."""
        self._stopping = True

    def process_one(self) -> bool:
        """Does the verification that waits longest; False when none waits."""
        claimed = self._verifications.claim_next()
        if claimed is None:
            return False
        try:
            report = self._verifier.verify(claimed.job_id)
        except (ArtifactStoreError, OperationalError) as error:
            # Not the job's fault: another worker does it when this one's claim is too old.
            log.warning("verification_put_off", job=claimed.job_id, error=str(error))
            return False
        except Exception as error:
            log.exception("verification_failed", job=claimed.job_id)
            report = Report([broken_off(f"it broke off: {error}")])
        if report.verdict == Verdict.REFUTED:
            log.error("refuted", job=claimed.job_id, verification=claimed.id)
        self._verifications.finish(
            claimed.id,
            report.as_document(),
            verdict=report.verdict,
            refuted_trials=report.refuted_trials,
        )
        return True

    def _do_next(self) -> None:
        try:
            processed = self.process_one()
        except Exception:
            # The reaper notifies again.
            log.exception("verifications_unreadable")
            processed = False
        with self._lock, suppress(RuntimeError):
            if processed and not self._stopping:
                self._threads.submit(self._do_next)  # refused when the process ends
                return
        with self._lock:
            self._active -= 1
