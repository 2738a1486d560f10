"""Slots of a runner: each leases a trial, runs it and transfers the outcome."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Final, get_args

import structlog

from buildarena_backend.errors import PermanentError, TransientError
from buildarena_backend.periodic import Periodic
from buildarena_backend.trials.simulator import Simulator
from buildarena_backend.trials.trials import FaultReason, File, TrialRequest, TrialResult
from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.task import task_of
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import write_trajectory
from buildarena_simworker.remote.api import (
    HeldLease,
    LeaseLostError,
    RefusedError,
    RemoteError,
    RunnerApi,
    UnreachableError,
)
from buildarena_simworker.trials import do_trial

BEATS_PER_LEASE: Final = 4
HAND_BACK_S: Final = 3.0
"""Time limit for releasing a lease at shutdown, seconds; a lease that is not released expires."""
WAIT_S: Final = 20.0
"""Time for which the API may hold a request for a trial, seconds."""
PAUSE_S: Final = 1.0
"""Pause of a slot after an unexpected error, seconds."""
LONGEST_DETAIL: Final = 2000
REASONS: Final = get_args(FaultReason)
"""Reasons that the API accepts; a custom simulator may have others."""

log = structlog.get_logger(__name__)


@dataclass(slots=True)
class _Active:
    """A lease that is worked under."""

    lease: HeldLease
    lost: threading.Event = field(default_factory=threading.Event)

    def require(self) -> None:
        if self.lost.is_set():
            raise LeaseLostError(f"lease {self.lease.token} on {self.lease.job_id} is over")


class Heartbeats:
    """Thread that keeps a runner's leases alive.

    Args:
        about: Data on the runner for each heartbeat.
        lease_s: Lifetime of a lease without heartbeats, seconds.
    """

    def __init__(
        self, api: RunnerApi, about: Callable[[], Mapping[str, Any]], *, lease_s: float
    ) -> None:
        self._api = api
        self._about = about
        self._period_s = lease_s / BEATS_PER_LEASE
        self._lock = threading.Lock()
        self._ended = threading.Condition(self._lock)
        self._active: dict[HeldLease, _Active] = {}
        self._thread = Periodic(self._beat, name="heartbeats", period_s=self._period_s)

    def start(self) -> None:
        """Report once and start the thread."""
        self._beat()
        self._thread.start()

    def drain(self, within_s: float) -> None:
        """Wait for running trials up to a time limit, with heartbeats."""
        with self._ended:
            self._ended.wait_for(lambda: not self._active, timeout=within_s)

    def stop(self) -> list[HeldLease]:
        """Stop the thread and interrupt running trials; return their leases."""
        self._thread.stop()
        with self._lock:
            active, self._active = list(self._active.values()), {}
        for active_lease in active:
            active_lease.lost.set()
        return [active_lease.lease for active_lease in active]

    @contextmanager
    def keeping(self, lease: HeldLease) -> Iterator[_Active]:
        """Keep a lease alive inside the block."""
        active = _Active(lease)
        with self._lock:
            self._active[lease] = active
        try:
            yield active
        finally:
            with self._ended:
                self._active.pop(lease, None)
                self._ended.notify_all()

    def _beat(self) -> None:
        with self._lock:
            leases = list(self._active)
        try:
            lost = self._api.heartbeat(self._about(), leases, within_s=max(1.0, self._period_s))
        except RemoteError as error:
            # The next one may get through; whether the leases live is the API's to say.
            log.warning("heartbeat_failed", error=str(error))
            return
        except Exception:
            log.exception("heartbeat_failed")
            return
        with self._lock:
            for lease in lost:
                if lease in self._active:
                    log.warning("lease_lost", job=lease.job_id, token=lease.token)
                    self._active[lease].lost.set()


class LeasedOverHttp:
    """A `TrialSource` from the API.

    Args:
        active: Lease of the trial.
        document: Description of the trial by the API.
    """

    def __init__(self, api: RunnerApi, active: _Active, document: Mapping[str, Any]) -> None:
        self._api = api
        self._active = active
        self._document = document
        self.evidence: list[dict[str, Any]] = []

    def take(self) -> TrialRequest:
        """Return the trial to run; see `TrialSource`."""
        document = self._document
        try:
            controls = document["controls"]
            return TrialRequest(
                job_id=self._active.lease.job_id,
                number=int(document["number"]),
                token=self._active.lease.token,
                version=str(document["version"]),
                task=task_of(TaskDocument.model_validate(document["task"])),
                machine=Machine.from_document(document["machine"]),
                controls=None
                if controls is None
                else tuple(KeyPress(**press) for press in controls),
                seed=document["seed"],
                require_held=self._active.require,
            )
        except Exception as error:
            raise TransientError(
                f"this runner can't read the trial, it may be older than the service: {error}",
                reason="unreadable_trial",
                delay_s=5.0,
            ) from error

    def complete(self, outcome: TrialResult) -> None:
        """Upload the trajectory and transfer it; see `TrialSource`."""
        lease, trajectory = self._active.lease, outcome.trajectory
        sent = None if trajectory is None else write_trajectory(trajectory)
        body = {
            "trajectory": None if sent is None else self._api.upload(lease, sent),
            "versions": dict(outcome.versions),
            "wall_s": outcome.wall_s,
            "files": self._uploaded(outcome.files),
            "annotations": None if outcome.annotations is None else dict(outcome.annotations),
        }
        try:
            self._api.end(lease, "outcome", body)
        except RefusedError as error:
            if error.is_of_the_key:
                raise
            raise TransientError(str(error), reason="outcome_refused", delay_s=5.0) from error

    def store_evidence(self, files: Mapping[str, File]) -> None:
        """Upload evidence of a fault, which its report then names; see `TrialSource`."""
        self.evidence = self._uploaded(files)

    def _uploaded(self, files: Mapping[str, File]) -> list[dict[str, Any]]:
        lease = self._active.lease
        return [
            {"name": name, "sha256": self._api.upload(lease, f.data)} for name, f in files.items()
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Slot:
    """A simulator with one lease at a time.

    Attributes:
        api: Source of trials.
        beats: Heartbeats of its leases.
        about: Data on the runner for requests of trials.
        stopping: Event after which it requests no more.
        stop_all: Function that ends the whole runner for a permanent reason.
    """

    api: RunnerApi
    beats: Heartbeats
    simulator: Simulator
    about: Mapping[str, Any]
    stopping: threading.Event
    stop_all: Callable[[str], None]

    def work(self) -> None:
        """Run trials until the runner stops."""
        while not self.stopping.is_set():
            try:
                self.do_next(WAIT_S)
            except UnreachableError as error:
                log.warning("gave_up", error=str(error))
            except RefusedError as error:
                log.warning("refused", error=str(error))
                if error.is_of_the_key:
                    self.stop_all(str(error))
                self.stopping.wait(PAUSE_S)
            except Exception:
                log.exception("slot_failed")
                self.stopping.wait(PAUSE_S)

    def do_next(self, wait_s: float) -> bool:
        """Return the leases and does one trial.

        Returns:
            Whether there was one.
        """
        document = self.api.lease(self.about, wait_s)
        if document is None:
            return False
        lease = HeldLease(job_id=str(document["job_id"]), token=int(document["token"]))
        if self.stopping.is_set():
            hand_back(self.api, lease)
            return False
        with self.beats.keeping(lease) as active:
            self._do(active, document)
        return True

    def _do(self, active: _Active, document: Mapping[str, Any]) -> None:
        lease, started = active.lease, time.perf_counter()
        leased = LeasedOverHttp(self.api, active, document)
        with structlog.contextvars.bound_contextvars(job=lease.job_id, token=lease.token):
            try:
                do_trial(self.simulator, leased)
            except LeaseLostError:
                log.warning("lease_over")
            except (TransientError, PermanentError) as error:
                self._fault(active, leased, error)
            except RemoteError:
                raise
            except Exception as error:
                log.exception("trial_failed")
                text = f"{type(error).__name__}: {error}"
                fault = TransientError(text, reason="internal_error", delay_s=2.0)
                self._fault(active, leased, fault)
            else:
                log.info("trial_done", seconds=round(time.perf_counter() - started, 3))

    def _fault(
        self, active: _Active, leased: LeasedOverHttp, error: TransientError | PermanentError
    ) -> None:
        if active.lost.is_set():
            return  # it was interrupted, which is not a fault
        log.warning("fault", reason=error.reason, detail=str(error))
        detail = str(error)[:LONGEST_DETAIL] or error.reason
        body = {
            "reason": error.reason if error.reason in REASONS else "simulator_fault",
            "detail": detail,
            "permanent": isinstance(error, PermanentError),
            "files": leased.evidence,
        }
        with suppress(LeaseLostError):
            self.api.end(active.lease, "fault", body)


def hand_back(api: RunnerApi, lease: HeldLease) -> None:
    """Release a lease at shutdown, if the API answers soon."""
    try:
        api.end(lease, "release", retry_for_s=HAND_BACK_S, although_over=True)
    except RemoteError as error:
        log.info("lease_release_failed", job=lease.job_id, error=str(error))
