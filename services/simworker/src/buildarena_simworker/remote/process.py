"""The runner's process: its slots, until it is asked to stop."""

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

import structlog

from buildarena_backend.errors import StartupError
from buildarena_backend.telemetry.logs import set_up_logs
from buildarena_backend.trials.simulator import Simulator
from buildarena_benchmark.environment.trials.processes import end_with_parent, tree_memory_bytes
from buildarena_geometry import __version__ as geometry_version
from buildarena_simworker.remote.api import (
    RemoteError,
    RunnerApi,
    UnreachableError,
    check_url,
    tls_context,
)
from buildarena_simworker.remote.slots import Heartbeats, Slot, hand_back

KEY_VARIABLE: Final = "BUILDARENA_KEY"
JOIN_S: Final = 3.0
_NAME = re.compile(r"[^A-Za-z0-9._-]+")

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunnerOptions:
    """How a runner is run.

    Attributes:
        url: Where the API is.
        key: The runner key; None where none is asked for.
        simulator: The simulator.
        version: Its version: only jobs that were submitted for it are leased.
        make: Makes the simulator of one slot.
        at_once: Trials at once.
        announced: What the service should know of the simulator besides its versions.
        ca_file: Certificates of authorities to trust besides the system's.
        allow_http: Whether the key may go unencrypted to another machine.
        finishing_s: Seconds that trials under way have when it is asked to stop.
        log_level: As in the settings.
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
    """The runner key: of a file, or of BUILDARENA_KEY; None when neither is given.

    Raises:
        StartupError: The file can't be read, or what is given is no key.
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
    """A runner's slots and heartbeats.

    Args:
        options: How it is run.

    Raises:
        StartupError: The URL or the certificates are of no use.
    """

    def __init__(self, options: RunnerOptions) -> None:
        self._options = options
        self.stopping, self._over = threading.Event(), threading.Event()
        self._why: str | None = None
        try:
            url = check_url(options.url, allow_http=options.allow_http)
            tls = tls_context(options.ca_file)
        except ValueError as error:
            raise StartupError(str(error)) from error
        self._api = RunnerApi(url, options.key, tls=tls, stopping=self.stopping, over=self._over)
        host = _NAME.sub("-", socket.gethostname()).strip("-._")[:40] or "runner"
        self._name = f"{host}-{os.getpid()}"
        self._peak = 0
        self._simulators: list[Simulator] = []

    def run(self) -> None:
        """Does trials until it is asked to stop.

        Raises:
            StartupError: The API refuses this runner; the message says why.
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

    def stop(self, why: str | None = None) -> None:
        """Has it stop: trials under way may finish in time, then they are handed back."""
        self._why = self._why or why
        self.stopping.set()

    def _admitted(self) -> float:
        facts = self._api.facts()
        name, version = self._options.simulator, self._options.version
        if name not in facts["simulators"]:
            allowed = ", ".join(facts["simulators"]) or "none"
            raise StartupError(f"this key may not lease jobs of {name}; it may those of: {allowed}")
        wanted = facts["versions"].get(name)
        if wanted != version:
            log.warning("other_version", simulator=name, here=version, service=wanted)
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
            self._api.goodbye(self._about(self._name))
        log.info("runner_stopped", handed_back=len(held))

    def _about(self, name: str) -> dict[str, Any]:
        self._peak = max(self._peak, tree_memory_bytes())
        return {
            "name": name,
            "simulators": {self._options.simulator: self._options.version},
            "versions": self._versions(),
            "pid": os.getpid(),
            "peak_memory_bytes": self._peak,
            "own_time": datetime.now(UTC).isoformat(),
        }

    def _versions(self) -> Mapping[str, Any]:
        own = self._simulators[0].versions if self._simulators else {}
        return {"geometry": geometry_version, **own, **self._options.announced}


def serve(options: RunnerOptions) -> None:
    """Runs a runner until the process is asked to stop.

    Raises:
        StartupError: It can't start, or the API takes it no longer.
    """
    set_up_logs(options.log_level)
    end_with_parent()
    runner = Runner(options)

    # A handler may interrupt whoever holds an event's lock: it only writes, and a thread stops.
    reads, writes = os.pipe()

    def asked(number: int, _: object) -> None:
        os.write(writes, bytes([number]))

    def stop() -> None:
        log.info("asked_to_stop", signal=signal.Signals(os.read(reads, 1)[0]).name)
        runner.stop()

    threading.Thread(target=stop, name="stopping", daemon=True).start()
    for name in ("SIGTERM", "SIGINT", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), asked)
    runner.run()
    sys.exit(0)
