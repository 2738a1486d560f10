"""Process of a runner: its slots, until shutdown."""

from __future__ import annotations

import os
import re
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import psutil
import structlog

from buildarena_backend.errors import StartupError
from buildarena_backend.telemetry.logs import set_up_logs
from buildarena_backend.trials.simulator import Simulator
from buildarena_benchmark.environment.trials.processes import end_with_parent, memory_bytes
from buildarena_geometry import __version__ as geometry_version
from buildarena_simworker.remote.api import RemoteError, RunnerApi, UnreachableError
from buildarena_simworker.remote.slots import Heartbeats, Slot, hand_back

KEY_VARIABLE: Final = "BUILDARENA_KEY"
JOIN_S: Final = 3.0
_NAME = re.compile(r"[^A-Za-z0-9._-]+")

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunnerOptions:
    """Options of a runner.

    Attributes:
        url: Address of the API.
        key: Runner key; None if none is required.
        simulator: Name of the simulator.
        version: Version of the simulator: only jobs that were submitted for it are leased.
        make: Function that creates the simulator of one slot.
        at_once: Number of concurrent trials.
        announced: Data for the service on the simulator, besides its versions.
        ca_file: Certificates of authorities to trust besides the system's.
        allow_http: True if the key may be sent unencrypted to another machine.
        finishing_s: Time limit at shutdown for running trials, seconds.
        log_level: Level as in the settings.
    """

    url: str
    key: str | None
    simulator: str
    version: str
    make: Callable[[], Simulator]
    at_once: int = 1
    announced: Mapping[str, Any] = field(default_factory=dict)
    ca_file: Path | None = None
    allow_http: bool = False
    finishing_s: float = 40.0
    log_level: str = "info"


def read_key(key_file: Path | None) -> str | None:
    """Return the runner key from a file or from BUILDARENA_KEY; None if neither is given.

    Raises:
        StartupError: The file can't be read, or the key is invalid.
    """
    key = os.environ.get(KEY_VARIABLE, "").strip()
    if key_file is not None:
        try:
            key = key_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise StartupError(f"{key_file} can't be read: {error}") from error
    if key and not (key.isascii() and key.isprintable() and " " not in key):
        raise StartupError(f"{key_file or KEY_VARIABLE} holds no key: keys are printable ASCII")
    return key or None


class Runner:
    """Slots and heartbeats of a runner.

    Raises:
        StartupError: The URL or the certificates are invalid.
    """

    def __init__(self, options: RunnerOptions) -> None:
        self._options = options
        self.stopping, self._over = threading.Event(), threading.Event()
        self._why: str | None = None
        self._api = RunnerApi(
            options.url,
            options.key,
            ca_file=options.ca_file,
            allow_http=options.allow_http,
            stopping=self.stopping,
            over=self._over,
        )
        host = _NAME.sub("-", socket.gethostname()).strip("-._")[:40] or "runner"
        self._name = f"{host}-{os.getpid()}"
        self._peak = 0
        self._simulators: list[Simulator] = []

    def run(self) -> None:
        """Run trials until shutdown.

        Raises:
            StartupError: The API refuses this runner; the message has the reason.
        """
        try:
            lease_s = self._admitted()
            self._serve(lease_s)
        except UnreachableError:
            log.info("stopped_before_the_api_answered")
        except RemoteError as error:
            raise StartupError(str(error)) from error
        finally:
            self._api.close()
        if self._why is not None:
            raise StartupError(self._why)

    def stop(self, reason: str | None = None) -> None:
        """Stop the runner: running trials may finish in time, then they are handed back."""
        self._why = self._why or reason
        self.stopping.set()

    def _admitted(self) -> float:
        facts = self._api.facts()
        name, version = self._options.simulator, self._options.version
        if name not in facts["simulators"]:
            allowed = ", ".join(facts["simulators"]) or "none"
            raise StartupError(f"this key may not lease jobs of {name}; it may those of: {allowed}")
        served = facts["versions"].get(name)
        if served != version:
            log.warning("simulator_version_mismatch", simulator=name, here=version, service=served)
        return float(facts["lease_s"])

    def _serve(self, lease_s: float) -> None:
        beats = Heartbeats(self._api, lambda: self._about(self._name), lease_s=lease_s)
        slots = []
        for number in range(self._options.at_once):
            simulator = self._options.make()
            self._simulators.append(simulator)
            slots.append(
                Slot(
                    api=self._api,
                    beats=beats,
                    simulator=simulator,
                    about=self._about(f"{self._name}.{number}"),
                    stopping=self.stopping,
                    stop_all=self.stop,
                )
            )
        threads = [threading.Thread(target=slot.work, daemon=True) for slot in slots]
        try:
            beats.start()
            for thread in threads:
                thread.start()
            log.info("runner_started", name=self._name, at_once=len(slots))
            # With a time-out, as otherwise no signal reaches the main thread on Windows.
            while not self.stopping.wait(0.5):
                pass
        finally:
            self.stopping.set()
            self._end(beats, threads)

    def _end(self, beats: Heartbeats, threads: list[threading.Thread]) -> None:
        # A key that is refused ends no trial: what it would bring is refused as well.
        if self._why is None:
            beats.drain(self._options.finishing_s)
        self._over.set()
        held = beats.stop()
        backs = [
            threading.Thread(target=hand_back, args=(self._api, lease), daemon=True)
            for lease in held
        ]
        for thread in backs:
            thread.start()
        # Slots that wait for a trial are left to it: they end with the process.
        until = time.monotonic() + JOIN_S
        for thread in (*backs, *threads):
            thread.join(max(0.0, until - time.monotonic()))
        for simulator in self._simulators:
            simulator.close()
        with suppress(RemoteError):
            self._api.leave(self._name)
        log.info("runner_stopped", handed_back=len(held))

    def _about(self, name: str) -> dict[str, Any]:
        own = psutil.Process()
        members = [own, *own.children(recursive=True)]
        self._peak = max(self._peak, sum(map(memory_bytes, members)))
        versions = self._simulators[0].versions if self._simulators else {}
        return {
            "name": name,
            "simulators": {self._options.simulator: self._options.version},
            "versions": {"geometry": geometry_version, **versions, **self._options.announced},
            "pid": os.getpid(),
            "peak_memory_bytes": self._peak,
            "reported_at": datetime.now(UTC).isoformat(),
        }


def serve(options: RunnerOptions) -> None:
    """Run a runner until the process is asked to stop.

    Raises:
        StartupError: It cannot start, or the API no longer accepts it.
    """
    set_up_logs(options.log_level)
    end_with_parent()
    runner = Runner(options)

    # A handler may interrupt whoever holds an event's lock: it only writes, and a thread stops.
    reads, writes = os.pipe()

    def request_shutdown(number: int, _: object) -> None:
        os.write(writes, bytes([number]))

    def stop() -> None:
        log.info("shutdown_requested", signal=signal.Signals(os.read(reads, 1)[0]).name)
        runner.stop()

    threading.Thread(target=stop, name="stopping", daemon=True).start()
    for name in ("SIGTERM", "SIGINT", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), request_shutdown)
    runner.run()
    sys.exit(0)
