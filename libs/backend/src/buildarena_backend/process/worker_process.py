"""A worker process: each message of its queues runs a stage handler."""

from __future__ import annotations

import os
import resource
import secrets
import signal
import socket
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Protocol

import structlog

from buildarena_backend.process.active_lease import LeaseKeeper
from buildarena_backend.process.context import Context, open_checked_context, open_context
from buildarena_backend.process.job_runner import JobRunner, OwnerSlots, StageHandler
from buildarena_backend.process.reaper import Reaper
from buildarena_backend.queue.consumer import FORKING_POOL, THREADS, Callbacks, consume
from buildarena_backend.settings import Settings
from buildarena_backend.telemetry.logs import set_up_logs
from buildarena_backend.telemetry.tracing import Tracing
from buildarena_benchmark.environment.trials.processes import die_with_parent, end_with_parent

log = structlog.get_logger(__name__)

CONNECTIONS_OF_THREADS = 16
"""Connections of a process of many threads: its sessions keep their replies at the same time, and
Postgres writes what comes together to its disk at once. All stay open, because a crowd that opens
and closes further ones pays more for these than for what it writes."""
SWITCH_S = 0.0005
"""Switch interval of a process with many threads: a session needs the interpreter after each answer
of the database, and waits up to this long while another one builds."""
CONNECTIONS_OF_FORKS = 2
"""Connections that a process with one job at a time keeps; as many again open for a moment."""


class SideWork(Protocol):
    """Work besides jobs, in separate threads that occupy no job's slot."""

    def wake(self) -> None:
        """Start the processing of waiting jobs; return at once."""

    def stop(self) -> None:
        """Begin nothing more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerSpec:
    """Specification of a worker.

    Attributes:
        kind: ``construct`` or ``simulate``.
        pool: Celery pool: ``threads``, ``prefork`` or ``solo``.
        concurrency: Jobs at once; in a pool of threads, of one owner (see `owner_slots`).
        make_handler: Makes the stage handler from a process' connections.
        make_side_work: Makes what else it does, by queue.
    """

    kind: str
    queues: Sequence[str]
    pool: str
    concurrency: int
    make_handler: Callable[[Context], StageHandler]
    make_side_work: Callable[[Context], Mapping[str, SideWork]] = lambda _: {}
    versions: Mapping[str, Any]


def worker_id(kind: str) -> str:
    """Return a unique name for this process: in containers all have the same number."""
    return f"{kind}@{socket.gethostname()}:{os.getpid()}-{secrets.token_hex(3)}"


class _Runtime:
    """The connections, threads and handler of one process that does stages."""

    def __init__(self, spec: WorkerSpec, settings: Settings) -> None:
        name = f"buildarena-{spec.kind}"
        if spec.pool == THREADS:
            sys.setswitchinterval(SWITCH_S)
            self.context = open_context(
                settings, pool_size=CONNECTIONS_OF_THREADS, overflow=0, name=name
            )
        else:
            self.context = open_context(settings, pool_size=CONNECTIONS_OF_FORKS, name=name)
        self.tracing = Tracing(f"{spec.kind}-worker", settings.otlp_endpoint)
        self.id = worker_id(spec.kind)
        self._spec = spec
        self._stopping = threading.Lock()
        self.keeper = LeaseKeeper(self.context.store.leases, self.report)
        self.others = spec.make_side_work(self.context)
        self.runner = JobRunner(
            self.context.store.leases,
            spec.make_handler(self.context),
            self.keeper,
            self.id,
            OwnerSlots(spec.concurrency if spec.pool == THREADS else 1),
        )

    def report(self) -> None:
        """Show that this process is alive: to its container, and to the register."""
        if self.context.settings.alive_file is not None:
            self.context.settings.alive_file.touch()
        peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        self.context.store.workers.report(
            worker_id=self.id,
            kind=self._spec.kind,
            queues=self._spec.queues,
            host=socket.gethostname(),
            pid=os.getpid(),
            versions=self._spec.versions,
            peak_memory_bytes=peak_kib * 1024,
            reported_at=datetime.now(UTC),
        )

    def start(self) -> None:
        """Start the heartbeat thread and reports."""
        self.report()
        self.keeper.start()

    def process(self, queue: str) -> None:
        """Do the jobs that wait in a queue; some of them in a process of one job at a time."""
        if queue in self.others:
            self.others[queue].wake()
        elif self._spec.pool == THREADS:
            self.runner.process_all(queue)
        elif self.runner.process_some(queue):
            self.context.queues.wake(queue)

    def begin_stop(self) -> None:
        """Take no further job, let those at hand finish a step, and hand the rest back."""
        self.runner.stop()
        for other in self.others.values():
            other.stop()
        with self._stopping:
            self.keeper.drain(self.context.settings.finishing_s)
            self.keeper.stop()

    def stop(self) -> None:
        """Hand leases back, leave the register and close the connections."""
        with self._stopping:  # a stop under way has leases to hand back
            self.keeper.stop()
        self.context.store.workers.leave(self.id)
        self.context.close()
        self.tracing.close()


def run_worker(spec: WorkerSpec, settings: Settings) -> None:
    """Serve queues until the process is asked to stop.

    Raises:
        StartupError: The database has another schema, or the settings are incomplete.
    """
    set_up_logs(settings.log_level)
    end_with_parent()
    context = open_checked_context(settings)
    runtimes: dict[int, _Runtime] = {}
    reaper = Reaper(context)

    def start() -> None:
        if spec.pool == FORKING_POOL:
            die_with_parent(signal.SIGKILL)
            end_with_parent(os.getppid())
        runtimes[os.getpid()] = runtime = _Runtime(spec, settings)
        runtime.start()

    def stop() -> None:
        runtime = runtimes.pop(os.getpid(), None)
        if runtime is not None:
            runtime.stop()

    def stopping() -> None:
        runtime = runtimes.get(os.getpid())
        if runtime is not None:
            runtime.begin_stop()

    def process(queue: str) -> None:
        runtimes[os.getpid()].process(queue)

    callbacks = Callbacks(
        process=process,
        start=start,
        stop=stop,
        stopping=stopping,
        ready=reaper.start,
    )
    threads = spec.pool == THREADS
    try:
        code = consume(
            context.queues,
            spec.queues,
            pool=spec.pool,
            concurrency=OwnerSlots(spec.concurrency).total if threads else spec.concurrency,
            callbacks=callbacks,
        )
    finally:
        reaper.stop()
        context.close()
    sys.exit(code)
