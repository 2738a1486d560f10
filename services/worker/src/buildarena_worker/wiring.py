"""Assembly of the construct worker's parts from a process' connections."""

from concurrent.futures import ThreadPoolExecutor
from threading import Semaphore

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.errors import ArtifactStoreError
from buildarena_backend.process.context import Context
from buildarena_backend.results.verifications import Verifications
from buildarena_backend.states import Verdict
from buildarena_worker.construct import ConstructHandler
from buildarena_worker.providers.provider import ModelClients
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.sessions import Sessions
from buildarena_worker.verify.report import Report, broken_off
from buildarena_worker.verify.verifier import Verifier

AT_ONCE = 2
"""Verifications that a process runs at once."""

log = structlog.get_logger(__name__)


class VerificationRunner:
    """Runner of requested verifications, in its own threads.

    Messages arrive in the threads of sessions: they only wake the runner.
    """

    def __init__(self, verifications: Verifications, verifier: Verifier) -> None:
        self._verifications = verifications
        self._verifier = verifier
        self._threads = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="verifying")
        self._places = Semaphore(AT_ONCE)
        self._stopping = False

    def wake(self) -> None:
        """Start the waiting verifications, unless the maximum is running."""
        if not self._stopping and self._places.acquire(blocking=False):
            self._threads.submit(self._process_all)

    def stop(self) -> None:
        """Start no more verifications."""
        self._stopping = True

    def process_one(self) -> bool:
        """Run the verification that waits longest; return False when none waits."""
        claimed = self._verifications.claim_next()
        if claimed is None:
            return False
        try:
            report = self._verifier.verify(claimed.job_id)
        except (ArtifactStoreError, OperationalError) as error:
            # Not the job's fault: another worker takes over when this claim expires.
            log.warning("verification_put_off", job=claimed.job_id, error=str(error))
            return False
        except Exception as error:
            log.exception("verification_failed", job=claimed.job_id)
            report = Report([broken_off(f"verification failed: {error}")])
        if report.verdict == Verdict.REFUTED:
            log.error("refuted", job=claimed.job_id, verification=claimed.id)
        self._verifications.finish(
            claimed.id,
            report.as_document(),
            verdict=report.verdict,
            refuted_trials=report.refuted_trials,
        )
        return True

    def _process_all(self) -> None:
        try:
            while not self._stopping and self.process_one():
                pass
        except Exception:
            # The reaper notifies again.
            log.exception("verifications_unreadable")
        finally:
            self._places.release()


def construct_handler(context: Context, registry: ModelRegistry) -> ConstructHandler:
    """Return the handler of the construct stage."""
    return ConstructHandler(
        store=context.store,
        artifacts=context.artifacts,
        queues=context.queues,
        registry=registry,
        clients=ModelClients(registry, context.settings.broker_url),
        sessions=Sessions(context),
        gate=ConcurrencyGate(),
    )


def verifier(context: Context) -> Verifier:
    """Return the verifier of finished jobs."""
    return Verifier(store=context.store, artifacts=context.artifacts, sessions=Sessions(context))


def verification_runner(context: Context) -> VerificationRunner:
    """Return the runner of requested verifications."""
    return VerificationRunner(context.store.verifications, verifier(context))
